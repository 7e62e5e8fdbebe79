"""Random arenas of several kinds; robots that fit through the gaps can go everywhere."""
