"""Learned methods: each is its networks and its communication rule."""
