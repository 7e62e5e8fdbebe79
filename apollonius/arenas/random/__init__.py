"""Random arenas of several kinds: in each of them every robot that fits through the gaps can go everywhere."""
