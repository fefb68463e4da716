"""RGB-D depth camera, the sensor of paper 1 (see `depth_camera`)."""

from uavexp.parameters import option
from uavexp.sensor.depth_camera import DepthCamera


@option
class Rgbd(DepthCamera):
    """RGB-D depth camera with switchable noise terms."""
