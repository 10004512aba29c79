"""The plant of record: how far arms of several shapes are from the chain, and whether scores converge."""
