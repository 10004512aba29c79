"""What learning is worth: trained agents beside classical laws and limits of what could be learned."""
