"""The equations: links, arm, modal elimination, kinematics, sensing, reference paths. Plain functions of numbers."""
