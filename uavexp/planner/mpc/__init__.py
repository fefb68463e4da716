"""Parts of `bspline_mpc`: the static spline, the horizon that follows it, the regions both keep out of."""
