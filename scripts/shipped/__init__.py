"""The shipped agent: trained with several seeds, chosen, exported, and shown in docs."""
