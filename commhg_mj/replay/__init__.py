"""Looking into flown missions: what a robot knew and why, the paper's case, how a team talked."""
