from setuptools import setup

SHARE = "share/apollonius_ros"

setup(
    name="apollonius_ros",
    version="0.1.0",
    packages=["apollonius_ros"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/apollonius_ros"]),
        (SHARE, ["package.xml"]),
        (f"{SHARE}/launch", ["launch/pursuit.launch.xml"]),
        (f"{SHARE}/config", ["config/params.yaml"]),
    ],
    install_requires=["setuptools"],
    extras_require={"bag": ["rosbags>=0.11"]},
    entry_points={
        "console_scripts": [
            "play = apollonius_ros.node:main",
            "bridge = apollonius_ros.bridge:main",
        ]
    },
)
