"""`export_onnx`: a trained policy as an ONNX file, for run times without Python. Format: https://onnx.ai/onnx/."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from flexarm_agents.policies.encoders import PastReadings
from flexarm_agents.policies.lstm import Lstm
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_env.extras import needs_extra
from flexarm_env.validation import shown

OPSET, IR = 17, 8  # versions that run times of 2022 and later read
Put = Callable[..., str]
ACTIVATIONS = {"elu": "Elu", "tanh": "Tanh", "relu": "Relu"}


def export_onnx(policy: NetworkPolicy, path: str | Path) -> None:
    """Write the deterministic policy: input `observation`, (n, k), output `action`, (n, actions), float32.

    A policy with a memory has further inputs `memory_0`, ... and outputs `next_memory_0`, ... Where an episode begins,
    fill the memory of past readings, (n, longest lag, numbers), with the present ones, and both memories of an LSTM,
    (n, h), with 0.

    Args:
        policy: e.g. `load_policy("square").policy`; its file's notes are not written.
        path: of the file.

    Raises:
        TypeError: for anything but a `NetworkPolicy`, or for one behind a Kalman filter, which is not exported.
        ModuleNotFoundError: without the package onnx, naming the extra.
    """
    if not isinstance(policy, NetworkPolicy) or not isinstance(policy.encoder, PastReadings | Lstm | None):
        raise TypeError(f"policy = {shown(policy)}: must be a NetworkPolicy with no encoder, a history or an LSTM")
    with needs_extra("export_onnx", "export"):
        import onnx
    nodes: list[Any] = []
    constants: list[Any] = []

    def put(operator: str, *inputs: Any, to: str = "", **attributes: Any) -> str:
        names = []
        for one in inputs:
            if not isinstance(one, str):
                constants.append(onnx.numpy_helper.from_array(np.asarray(one, order="C"), f"c{len(constants)}"))
            names.append(one if isinstance(one, str) else constants[-1].name)
        nodes.append(onnx.helper.make_node(operator, names, [to or f"x{len(nodes)}"], **attributes))
        return str(nodes[-1].output[0])

    x, memory = "observation", list[tuple[int, ...]]()
    if policy.encoder is not None:
        encode: Any = _lstm if isinstance(policy.encoder, Lstm) else _history
        x, memory = encode(put, policy.encoder)
    for weight, bias in zip(policy.weights[:-1], policy.biases[:-1], strict=True):
        x = put(ACTIVATIONS[policy.activation], put("Gemm", x, weight, bias, transB=1))
    x = put("Gemm", x, policy.weights[-1], policy.biases[-1], transB=1)
    head = ("Tanh", x) if policy.log_std_weights is not None else ("Clip", x, np.float32(-1.0), np.float32(1.0))
    put(*head, to="action")

    def values(sizes: dict[str, tuple[int, ...]]) -> list[Any]:
        kind = onnx.TensorProto.FLOAT
        return [onnx.helper.make_tensor_value_info(name, kind, ["n", *size]) for name, size in sizes.items()]

    inputs = {"observation": (policy.observation_size,)} | {f"memory_{n}": size for n, size in enumerate(memory)}
    outputs = {"action": policy.log_std.shape} | {f"next_memory_{n}": size for n, size in enumerate(memory)}
    whole = onnx.helper.make_graph(nodes, "policy", values(inputs), values(outputs), constants)
    model = onnx.helper.make_model(whole, opset_imports=[onnx.helper.make_opsetid("", OPSET)], ir_version=IR)
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, path)


def _history(put: Put, encoder: PastReadings) -> tuple[str, list[tuple[int, ...]]]:
    """Return the network's inputs and the memory's shapes; see `PastReadings.advance`."""
    now = put("Gather", "observation", np.array(encoder.remembered), axis=1)
    past = put("Gather", "memory_0", np.array(encoder.lags) - 1, axis=1)
    kept = put("Slice", "memory_0", np.array([0]), np.array([-1]), np.array([1]))
    put("Concat", put("Unsqueeze", now, np.array([1])), kept, to="next_memory_0", axis=1)
    flat = put("Reshape", past, np.array([0, -1]))
    return put("Concat", "observation", flat, axis=1), [(encoder.lags[-1], len(encoder.remembered))]


def _lstm(put: Put, encoder: Lstm) -> tuple[str, list[tuple[int, ...]]]:
    """Return the network's inputs and the memory's shapes; see `Lstm.advance`."""
    remembered = put("Gemm", "memory_0", encoder.lstm_memory, encoder.lstm_bias, transB=1)
    sums = put("Add", put("Gemm", "observation", encoder.lstm_input, transB=1), remembered)
    h = encoder.inputs
    let_in, keep, new, let_out = (
        put("Tanh" if n == 2 else "Sigmoid", put("Slice", sums, *np.array([[n * h], [n * h + h], [1]])))
        for n in range(4)
    )
    kept, added = put("Mul", keep, "memory_1"), put("Mul", let_in, new)
    cells = put("Add", kept, added, to="next_memory_1")
    out = put("Mul", let_out, put("Tanh", cells), to="next_memory_0")
    return out, [(h,), (h,)]
