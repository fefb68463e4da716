"""Parts of `bspline_mpc`: the guide, the horizon that follows it, the regions both keep out of."""
