"""An ONNX graph as it is written: nodes and constants, and what each column of each tensor is called."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from onnx import NodeProto, TensorProto, helper, numpy_helper

ONE = "1"
"""In a `Row`, the constant term."""
Layers = list[tuple[np.ndarray, np.ndarray]]
"""Weight [out, in] and bias [out] of each layer."""
Row = dict[str, float]
"""A number that is linear in others: their factors by name."""


@dataclass
class Graph:
    """What has been added so far. Every tensor that has columns is `[batch, columns]`."""

    nodes: list[NodeProto] = field(default_factory=list)
    constants: list[TensorProto] = field(default_factory=list)
    columns: dict[str, list[str]] = field(default_factory=dict)
    given: list[TensorProto] = field(default_factory=list)
    """Inputs that have a value unless they are given another."""

    def add(
        self, operator: str, inputs: list[str | np.ndarray], output: str, columns: list[str] | None = None, **more: Any
    ) -> str:
        """A node, called as its output; an input that is an array becomes a constant, `more` its attributes."""
        names = [value if isinstance(value, str) else self._constant(value) for value in inputs]
        self.nodes.append(helper.make_node(operator, names, [output], name=output, **more))
        self.columns[output] = columns or []
        return output

    def give(self, name: str, value: np.ndarray) -> None:
        """An input that need not be given: it has this value then."""
        self.given.append(numpy_helper.from_array(value, name))

    def clip(
        self, source: str, low: float | int, high: float | int, output: str, columns: list[str] | None = None
    ) -> str:
        """The same columns within bounds."""
        return self.add("Clip", [source, np.array(low, np.float32), np.array(high, np.float32)], output, columns)

    def split(self, source: str, sizes: list[int], outputs: list[str]) -> None:
        """Tensors that are parts of another along its second axis."""
        self.nodes.append(helper.make_node("Split", [source, self._constant(np.array(sizes))], outputs, axis=1))

    def linear(self, source: str, output: str, rows: dict[str, Row]) -> str:
        """New columns, each linear in those of `source`."""
        weight, bias = matrix(self.columns[source], list(rows.values()))
        return self.add("Gemm", [source, *_single(weight, bias)], output, [*rows], transB=1)

    def network(self, source: str, layers: Layers, output: str) -> str:
        """Layers, a ReLU after each but the last."""
        for number, (weight, bias) in enumerate(layers[:-1]):
            affine = self.add("Gemm", [source, *_single(weight, bias)], f"layer {number}", transB=1)
            source = self.add("Relu", [affine], f"hidden {number}")
        return self.add("Gemm", [source, *_single(*layers[-1])], output, transB=1)

    def join(self, sources: list[str], output: str) -> str:
        """All columns of several tensors."""
        columns = [name for source in sources for name in self.columns[source]]
        return self.add("Concat", [*sources], output, columns, axis=1)

    def _constant(self, value: np.ndarray) -> str:
        name = f"constant {len(self.constants)}"
        self.constants.append(numpy_helper.from_array(value, name))
        return name


def matrix(columns: list[str], rows: list[Row]) -> tuple[np.ndarray, np.ndarray]:
    """Factors [rows, columns] and constant terms [rows], in double precision.

    Raises:
        KeyError: for a row in a column there is not.
    """
    place = {name: index for index, name in enumerate([*columns, ONE])}
    factors = np.zeros((len(rows), len(place)))
    for index, row in enumerate(rows):
        for name, factor in row.items():
            factors[index, place[name]] += factor
    return factors[:, :-1], factors[:, -1]


def _single(*arrays: np.ndarray) -> list[np.ndarray]:
    return [array.astype(np.float32) for array in arrays]
