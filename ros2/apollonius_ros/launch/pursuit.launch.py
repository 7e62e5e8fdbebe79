"""Start the node of one robot: `ros2 launch apollonius_ros pursuit.launch.py name:=pursuer params:=params.yaml`."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PARAMETERS = Path(__file__).resolve().parents[1] / "config" / "params.yaml"


def generate_launch_description():
    name, params = LaunchConfiguration("name"), LaunchConfiguration("params")
    return LaunchDescription(
        [
            DeclareLaunchArgument("name", default_value="pursuer", description="of the node: a section of the file"),
            DeclareLaunchArgument("params", default_value=str(PARAMETERS), description="file of parameters"),
            Node(
                package="apollonius_ros",
                executable="play",
                name=name,
                parameters=[params],
                output="screen",
                sigterm_timeout="10",  # braking takes as long
            ),
        ]
    )
