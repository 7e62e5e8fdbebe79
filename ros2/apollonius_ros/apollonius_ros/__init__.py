"""ROS 2 nodes: one drives a robot of a pursuit-evasion game by an exported player, one places it on
a map.
"""

import sys


def end_without_ros(error: ImportError) -> None:
    """Say in a line what is missing, and end the program with status 2."""
    remedy = "install ROS 2, and give first: source /opt/ros/DISTRIBUTION/setup.bash"
    print(f"apollonius_ros: {str(error).splitlines()[0]}: {remedy}", file=sys.stderr)
    sys.exit(2)
