"""Missions of human operators, aerial and ground robots under limited communication, in MuJoCo worlds."""

__version__ = "0.1.0"
