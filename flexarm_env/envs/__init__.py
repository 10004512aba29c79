"""The Gymnasium environments: single, vector, options, infos, rendering, registration."""
