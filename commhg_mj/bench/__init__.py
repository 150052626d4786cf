"""Speeds of this machine: kernels, worlds, training, interfaces beside other people's."""
