"""MuJoCo worlds: layout, terrain, ground routes, MJCF and rays."""
