"""The package's build, for colcon."""

from setuptools import setup

NAME = "gestured_ros2"

setup(
    name=NAME,
    version="0.2.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/gestured.launch.xml"]),
    ],
    install_requires=["gestured"],
    entry_points={"console_scripts": [f"gestures = {NAME}.node:main"]},
)
