# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The package, for pip and for colcon alike."""

from glob import glob

from setuptools import find_packages, setup

NAME = 'imu_noise_tools'
NODES = ('bag_reader', 'analyser', 'calibration', 'filter')

setup(
    name=NAME,
    version='0.1.0',
    description='How good is an IMU, and what is wrong with the model of it: Allan variance, '
                'noise models, calibration and denoising for recorded bags and live topics.',
    long_description='See README.md.',
    maintainer='imu_noise_tools maintainers',
    maintainer_email='maintainers@imu-noise-tools.example',
    url='https://imu-noise-tools.example/',
    project_urls={
        'Source': 'https://imu-noise-tools.example/imu_noise_tools.git',
        'Tracker': 'https://imu-noise-tools.example/issues',
    },
    license='Apache-2.0',
    keywords=['ROS', 'IMU', 'Allan variance', 'gyroscope', 'accelerometer', 'calibration'],
    classifiers=[
        'Intended Audience :: Developers',
        'Intended Audience :: Science/Research',
        'Programming Language :: Python :: 3',
        'Topic :: Scientific/Engineering',
    ],
    python_requires='>=3.10',
    packages=find_packages(exclude=['test', 'test.*']),
    package_data={NAME: ['py.typed', '**/*.yaml', '**/*.npz', '**/*.json']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/launch', sorted(glob('launch/*.launch.py'))),
        (f'share/{NAME}/config', sorted(glob('config/*.*'))),
        (f'share/{NAME}/config/sheets', sorted(glob('config/sheets/*.yaml'))),
    ],
    install_requires=[
        'allantools',
        'argcomplete',
        'lz4',
        'matplotlib',
        'numpy>=1.26',
        'pyyaml',
        'rosbags>=0.10',
        'scipy>=1.11',
        'zstandard',
    ],
    extras_require={
        # Only where no ROS is installed: wheels of the same packages. Without [fastrtps] rclpy has
        # no middleware and cannot be imported.
        'ros': ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces'],
        'explore': ['fastapi', 'nicegui>=3', 'uvicorn'],
        'fleet': ['bokeh', 'dask[distributed]', 'fsspec', 'pyarrow'],
        'notebook': ['pandas'],
        'test': [
            'colcon-common-extensions',
            'dask[distributed]',
            'fsspec',
            'hypothesis',
            'nicegui>=3',
            'pandas',
            'playwright',
            'pyarrow',
            'pytest',
            'pytest-timeout',
            'pytest-xdist',
            'setuptools<80',            # what colcon-core can drive
            'wheel',
        ],
        'docs': ['furo', 'myst-parser', 'sphinx>=7.2'],
        # Pinned: a new version finds new faults, and a change answers for its own alone.
        'lint': [
            'flake8==7.4.1',
            'flake8-import-order==0.19.2',
            'mypy==2.4.0',
            'pydocstyle==6.3.0',
            'types-PyYAML',
        ],
    },
    zip_safe=False,
    entry_points={
        'console_scripts': [
            *(f'{node} = {NAME}.nodes.{node}:main' for node in NODES),
            f'imu_noise = {NAME}.cli.main:main',
        ],
    },
)
