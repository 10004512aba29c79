"""Control of the joints: references, feed-forward of the bending arm, command shaping, and feedback (`tracking`)."""
