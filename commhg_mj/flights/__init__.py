"""Flying many missions with one policy, in one process or several, and what their figures are worth."""
