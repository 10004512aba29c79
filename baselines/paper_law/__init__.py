"""The paper's law: its gain constant (`ifdc`) or from a fuzzy system of the links' deflections (`flsac`, `fuzzy`)."""
