"""The default arm: how far arms of several shapes are from the chain, and whether scores converge."""
