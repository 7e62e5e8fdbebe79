"""Random arenas of several kinds, in which every robot that fits through the gaps can go everywhere."""
