"""The shipped agents: trained with several seeds, chosen, exported, and shown in docs."""
