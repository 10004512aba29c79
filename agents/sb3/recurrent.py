"""`SequencePolicy`: sb3-contrib's recurrent policy, whose learning runs through whole sequences at once."""

from __future__ import annotations

from typing import Any, cast

import torch
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy

Memory = tuple[torch.Tensor, torch.Tensor]


class SequencePolicy(RecurrentActorCriticPolicy):
    """The "MlpLstmPolicy" of sb3-contrib, with the same numbers in less time.

    A minibatch of RecurrentPPO consists of sequences, and an episode can begin only with one. The library runs all of
    them period by period as soon as one begins an episode; here their memory is emptied before, and the layer
    runs through all periods in one call.
    """

    @staticmethod
    def _process_sequence(  # type: ignore[override]  # the library declares a tensor where it returns the memory
        features: torch.Tensor, lstm_states: Memory, episode_starts: torch.Tensor, lstm: Any
    ) -> tuple[torch.Tensor, Memory]:
        """Run the layer through sequences.

        Args:
            features: what it sees, one sequence after the other. Shape (n k, features).
            lstm_states: its output and cells before each. Shape (1, n, h) each.
            episode_starts: 1 where an episode begins. Shape (n k,).
            lstm: the layer.

        Returns:
            Its outputs, in the order of the features, and its memory after each sequence.
        """
        sequences = lstm_states[0].shape[1]
        starts = episode_starts.reshape(sequences, -1)
        if torch.any(starts[:, 1:]):
            whole = RecurrentActorCriticPolicy._process_sequence(features, lstm_states, episode_starts, lstm)
            return cast("tuple[torch.Tensor, Memory]", whole)
        kept = (1.0 - starts[:, 0]).view(1, sequences, 1)
        periods = features.reshape(sequences, -1, lstm.input_size).swapaxes(0, 1)
        outputs, memory = lstm(periods, (kept * lstm_states[0], kept * lstm_states[1]))
        return torch.flatten(outputs.transpose(0, 1), start_dim=0, end_dim=1), memory
