# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Analyse and filter a running IMU: analyser and filter listen to imu/data_raw."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

CONFIG = Path(__file__).resolve().parents[1] / 'config'


def node(name, **parameters):
    """Return a node with its own file of config/, then params_file, then these parameters."""
    return Node(
        package='imu_noise_tools', executable=name, name=name,
        namespace=LaunchConfiguration('namespace'), output='screen',
        remappings=[('imu/data_raw', LaunchConfiguration('imu'))],
        ros_arguments=['--log-level', LaunchConfiguration('log_level')],
        parameters=[str(CONFIG / f'{name}.yaml'), LaunchConfiguration('params_file'), {
            'use_sim_time': LaunchConfiguration('use_sim_time'), **parameters}])


def generate_launch_description():
    """Return the arguments and the nodes."""
    return LaunchDescription([
        DeclareLaunchArgument('imu', default_value='imu/data_raw',
                              description='topic of the driver'),
        DeclareLaunchArgument('accel', default_value='', description='topic of the accelerations, '
                              'where they have one of their own (a depth camera)'),
        DeclareLaunchArgument('namespace', default_value='', description='of the nodes'),
        DeclareLaunchArgument('params_file', default_value=str(CONFIG / 'filter.yaml'),
                              description='parameters of the nodes, keyed /**'),
        DeclareLaunchArgument('use_sim_time', default_value='false',
                              description='whether time comes from /clock'),
        DeclareLaunchArgument('log_level', default_value='info',
                              description='debug, info, warn or error'),
        node('analyser', input='messages', accel_topic=ParameterValue(
            LaunchConfiguration('accel'), value_type=str)),     # nothing is a string, too
        node('filter'),
    ])
