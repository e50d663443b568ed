# Copyright 2026 ride_estimation contributors
"""Play a recorded run through the live estimator: ``ros2 launch ride_estimation replay.launch.py bag:=my_run``."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from ride_estimation.resources import shared_path


def generate_launch_description() -> LaunchDescription:
    """Return the estimator of estimation.launch.py and a player for one bag."""
    estimation = str(shared_path("launch", "estimation.launch.py"))
    passed_on = {name: LaunchConfiguration(name) for name in ("vehicle", "namespace", "log_level")}
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", description="rosbag2 folder, .mcap, .db3 or ROS 1 .bag"),
            DeclareLaunchArgument("rate", default_value="1.0", description="speed of replay, 1 is real time"),
            DeclareLaunchArgument(
                "wait_for_subscribers", default_value="0.0", description="longest wait for the estimator [s], 0 waits for ever"
            ),
            DeclareLaunchArgument("vehicle", default_value="truck_cab", description="vehicle file, or the name of a bundled one"),
            DeclareLaunchArgument("namespace", default_value="ride", description="namespace of nodes and outputs"),
            DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn or error"),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(estimation),
                launch_arguments={**passed_on, "use_sim_time": "true"}.items(),
            ),
            Node(
                package="ride_estimation",
                executable="replay_node",
                name="replay",
                namespace=LaunchConfiguration("namespace"),
                output="screen",
                parameters=[
                    {
                        "bag": ParameterValue(LaunchConfiguration("bag"), value_type=str),
                        "rate": ParameterValue(LaunchConfiguration("rate"), value_type=float),
                        "wait_for_subscribers": ParameterValue(LaunchConfiguration("wait_for_subscribers"), value_type=float),
                        "wait_for_node": ParameterValue([LaunchConfiguration("namespace"), "/estimator"], value_type=str),
                    }
                ],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
            ),
        ]
    )
