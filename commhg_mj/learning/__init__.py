"""Learned methods: graphs, networks, rollout, PPO, runs, and the weights that come along (docs/learning.md)."""
