# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Analyse a recorded bag: bag_reader feeds analyser, block by block.

It ends by itself once everything is written, with status 1 where something failed.

"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIG = Path(__file__).resolve().parents[1] / 'config'


def ended(event, context):
    """End the launch with either node; what is raised here makes its status 1."""
    if event.returncode and not context.is_shutdown:
        raise RuntimeError(f'{event.process_name} failed with status {event.returncode}')
    return [Shutdown(reason=f'{event.process_name} is done')]


def node(name, **parameters):
    """Return a node with its own file of config/, then params_file, then these parameters."""
    return Node(
        package='imu_noise_tools', executable=name, name=name,
        namespace=LaunchConfiguration('namespace'), output='screen', on_exit=ended,
        ros_arguments=['--log-level', LaunchConfiguration('log_level')],
        parameters=[str(CONFIG / f'{name}.yaml'), LaunchConfiguration('params_file'), {
            'use_sim_time': LaunchConfiguration('use_sim_time'), **parameters}])


def generate_launch_description():
    """Return the arguments and the nodes."""
    return LaunchDescription([
        DeclareLaunchArgument('bag', description='rosbag1, rosbag2, .mcap, .db3, .csv or .npz'),
        DeclareLaunchArgument('namespace', default_value='', description='of the nodes'),
        DeclareLaunchArgument('params_file', default_value=str(CONFIG / 'analyser.yaml'),
                              description='parameters of the nodes, keyed /**'),
        DeclareLaunchArgument('use_sim_time', default_value='false',
                              description='whether time comes from /clock'),
        DeclareLaunchArgument('log_level', default_value='info',
                              description='debug, info, warn or error'),
        DeclareLaunchArgument('output_dir', default_value='analyser.study',
                              description='where the study goes; name.2.study if it is there'),
        DeclareLaunchArgument('exit_at_end', default_value='true',
                              description='whether to end when the bag is analysed'),
        node('analyser', input='buffer', output_dir=LaunchConfiguration('output_dir'),
             exit_at_end=LaunchConfiguration('exit_at_end')),
        node('bag_reader', bag=LaunchConfiguration('bag'), publish='buffer',
             readers=['analyser']),
    ])
