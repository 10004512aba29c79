"""Jobs in processes of this machine, on a Ray cluster or by Slurm, and how they stop."""
