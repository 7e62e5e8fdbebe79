"""Programs in C do what JAX does, primitive by primitive, loop by loop."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpr2c import CompiledProgram, Unsupported, translate
from tests.jaxpr2c.gcc import SANITIZED, STRICT, needs_gcc

lax = jax.lax


def real(x, y):
    """Operations on real numbers, `[4]` each; `y` is positive."""
    z = x * y - x / y + (x - y)
    i32, u16, even = jnp.int32, jnp.uint16, lax.RoundingMethod.TO_NEAREST_EVEN
    return {
        "power": [x**2, x**3, x**-3, x**7, jnp.power(y, x), jnp.sqrt(y), lax.rsqrt(y), lax.cbrt(x), lax.square(x)],
        "exp": [jnp.exp(x), jnp.exp2(x), jnp.expm1(x), jnp.log(y), jnp.log1p(y), lax.logistic(x)],
        "angles": [jnp.sin(x), jnp.cos(x), jnp.tan(x), jnp.arctan(x), jnp.arctan2(x, y), jnp.tanh(x)],
        "more": [jnp.arcsin(x / 9), jnp.arccos(x / 9), jnp.sinh(x), jnp.cosh(x)],
        "whole": [jnp.floor(x), jnp.ceil(x), lax.round(x, even), lax.round(x), lax.sign(x)],
        "order": [jnp.maximum(x, y), jnp.minimum(x, jnp.nan), abs(x), -x, lax.rem(x, y), jnp.clip(x, -1.0, 1.0)],
        "truth": [x < y, x <= y, x > y, x >= y, x == x, x != y, jnp.isfinite(x / 0), ~(x < 0), (x < 0) ^ (y > 1)],
        "kinds": [(100 * x).astype(i32), x.astype(bool), (x * 1e12).astype(i32), (9 * y).astype(u16)],
        "bits": [lax.bitcast_convert_type(x, jnp.uint32), lax.bitcast_convert_type(z.view(jnp.int32), jnp.float32)],
        "chosen": [jnp.where(x < 0, x, y), lax.select_n((y > 1).astype(i32) + (x > 0), x, y, z), jnp.where(True, x, y)],
    }


def whole(i, n):
    """Operations on whole numbers, `[4]` each; `n` is positive and small."""
    u = i.astype(jnp.uint32)
    return {
        "sums": [i + n, i - n, i * n, i // n, i % n, lax.rem(i, n), -i, abs(i), lax.sign(i), jnp.maximum(i, n), i**2],
        "bits": [i & n, i | n, i ^ n, ~i, i << n, i >> n, lax.shift_right_logical(u, u * 0 + 40), u >> 3, u * u],
        "kinds": [i.astype(jnp.uint8), i.astype(jnp.int8) + jnp.int8(100), u.astype(jnp.float32), i.astype(bool)],
    }


def arrays(a, k):
    """Arrays `[3, 4]` seen otherwise, joined, folded and multiplied; `k` is an index that may be out of bounds."""
    row, tall, places = a[1], a.T.reshape(2, 6), (jnp.array([2, 0]), jnp.array([1, 3]))
    return {
        "views": [a.T, a[::2, 1:3], a[::-1], a.reshape(4, 3), a[None], jnp.broadcast_to(row, (2, 4)), a[:, :1] + a[:1]],
        "joined": [jnp.concatenate([a, -a], 1), jnp.stack([row, 2 * row], 1)],
        "padded": jnp.pad(a, ((1, 0), (0, 2)), constant_values=7),
        "folded": [a.sum(), a.sum(0), a.max(1), a.min((0, 1)), a.prod(0), (a > 0).any(), (a > 0).all(1)],
        "where": [jnp.argmax(a, 1), jnp.argmin(a[0]), jnp.argmax(a > 99)],
        "nan": [order(jnp.where(a < 0, a, jnp.nan), 1) for order in (jnp.argmax, jnp.argmin)],
        "running": [jnp.cumsum(a, 1), jnp.cumprod(a, 0), lax.cummax(a, 1), lax.cummin(a, 0, reverse=True)],
        "products": [a @ row, row @ a.T, a @ a.T, jnp.einsum("ij,ik->ijk", a, tall.reshape(3, 4)), row @ row],
        "batch": [jnp.einsum("bij,bjk->bik", jnp.stack([a, -a]), jnp.stack([a.T, a.T + 1]))],
        "nulls": [jnp.maximum(row, 0) @ jnp.tile(a.T, (1, 5))],
        "indexed": [a[k], a.at[k].get(mode="fill"), a.at[:, k].get(mode="clip"), a[places]],
        "whole": [jnp.arange(3).at[k].get(mode="fill"), jnp.arange(3, dtype=jnp.uint8).at[k].get(mode="fill")],
        "written": [
            a.at[k].set(7.0),
            a.at[:, k].set(row[:3], mode="clip"),
            a.at[jnp.array([2, 0, 2]), jnp.array([1, 3, 1])].add(row[:3]),
            a.at[jnp.array([0, k])].multiply(tall[:, :4]),
            a.at[jnp.array([[1], [k]]), jnp.array([0, 2])].max(5.0),
            a.at[1, jnp.array([3, 0])].min(tall[0, :2]),
            jnp.zeros((2, 3), bool).at[jnp.array([0, 1, k]), jnp.array([2, 0, 1])].max(row[:3] > -9),
        ],
        "sliced": [lax.dynamic_slice(a, (k, k), (2, 3)), lax.dynamic_update_slice(a, row[None, :2], (k, 1))],
        "split": jnp.split(a, 2, axis=1),
        "constant": a + np.arange(12, dtype=np.float32).reshape(3, 4) ** 2,
        "counted": [lax.iota(jnp.float32, 5), jnp.arange(4)[None] + jnp.arange(3)[:, None]],
        "rows": jax.vmap(lambda line, at: line[at])(a, jnp.array([0, 3, 2])),
        "each": jax.vmap(lambda line, at: line.at[at].add(1))(a, jnp.array([0, 3, 2])),
    }


def flow(x, n):
    """Loops and branches over `[3]` and a whole number of steps."""

    def turn(carry, seen):
        one, other, total = carry
        return (other, one + seen, total + other.sum()), (one * seen, total)

    def collatz(state):
        number, steps = state
        return jnp.where(number % 2 == 0, number // 2, 3 * number + 1), steps + 1

    def nested(carry, _):
        return lax.fori_loop(0, 3, lambda i, inner: jnp.roll(inner, 1) * 0.5 + i, carry), carry[0]

    rows = jnp.stack([x, x + 1, -x])
    return {
        "scan": lax.scan(turn, (x, 2 * x, jnp.float32(0)), rows),
        "backwards": lax.scan(turn, (x, 2 * x, jnp.float32(0)), rows, reverse=True),
        "once": lax.scan(turn, (x, 2 * x, jnp.float32(0)), rows[:1]),
        "until": lax.while_loop(lambda state: state[0] > 1, collatz, (n, jnp.int32(0))),
        "nested": lax.scan(nested, x, None, length=4),
        "cond": lax.cond(n > 5, lambda x: x + 1, lambda x: -x, x),
        "branches": [lax.switch(n - at, [lambda x: x, lambda x: x[::-1], lambda x: 0 * x], x) for at in (6, 7, 9, 20)],
        "relu": jax.nn.relu(x),
        "saved": jax.checkpoint(lambda x: jnp.sin(x) * 2)(x),
    }


@jax.jit
def long(x, y):
    """Some thirty equations, so that it stays a function."""
    for factor in range(1, 11):
        x = jnp.sin(x / factor) + y.sum() / factor
    return x, x[0] * y


def calls(x):
    """One function of two kinds of arguments, and of parts of arrays."""
    one, two = long(x, x[1:]), long(x[::-1], x[:2] * 2)
    return {"one": one, "two": two, "again": long(one[0], x[1:])}


X = np.array([-2.5, 0.5, 3.25, -0.0], np.float32)
Y = np.array([0.5, 1.75, 2.0, 1e-3], np.float32)
A = np.array([[1.5, -2, 0, 4], [3, 0, -1, 2], [-4, 7, 5, -6]], np.float32)


CASES = [
    (real, [(X, Y)]),
    (whole, [(np.array([-7, 0, 5, 9], np.int32), np.array([2, 3, 1, 4], np.int32))]),
    (arrays, [(A, np.int32(k)) for k in (1, -1, 9)]),  # within the bounds, before and beyond
    (flow, [(X[:3], np.int32(7))]),
    (calls, [(X[:3],)]),
]


@needs_gcc
@pytest.mark.parametrize(("function", "cases"), CASES)
def test_c_programs_match_jax(function, cases):
    program = translate(function, *cases[0], name="tried")
    compiled, by_jax = CompiledProgram(program, SANITIZED), jax.jit(function)
    for arguments in cases:
        made = jax.tree.leaves(dict(sorted(by_jax(*arguments).items())))
        for found, wanted in zip(compiled(*arguments), made, strict=True):
            np.testing.assert_allclose(found, wanted, rtol=2e-6, atol=2e-6)
    if function is calls:  # a function that is called stays one, and equal ones are one
        assert (len(program.functions), program.source().count("op_long_1(")) == (1, 4)


def test_translation_is_deterministic_and_describes_the_argument_layout():
    def shifted(arena, number):
        jnp.sin(number) + A  # nothing needs this
        return arena["walls"][0] + number, {"far": arena["discs"].sum() * number}

    given = {"walls": (np.float32(1), np.int8(2)), "discs": np.ones((2, 3), np.float32)}, np.float32(2)
    program, again = (translate(shifted, *given, name="moved") for _ in range(2))
    assert (program.source(), program.header()) == (again.source(), again.header())
    arena, number = program.arguments
    assert [leaf.name for leaf in arena.leaves] == ["discs", "walls_0"]
    assert (*arena.offsets, arena.layout.itemsize) == (0, 24, 28)  # nobody reads the second wall
    assert number.is_array
    assert "void moved(const moved_arena *arena, float number, moved_result *result);" in program.header()
    assert "float discs[6]; /* 2 x 3 */" in program.header()
    assert not {"sinf", "static"} & set(program.source().split())
    discs, wall = arena.unpack(arena.pack(given[0]))
    np.testing.assert_array_equal(discs, given[0]["discs"])
    assert wall == 1


def ends(a, b):
    """Operations on whole numbers of all sizes, in sums also as they are compared before they are stored."""
    both = [lax.add, lax.sub, lax.mul, lax.div, lax.rem, lax.bitwise_xor, lax.max, lax.min, lax.lt, lax.shift_left]
    both += [lax.shift_right_logical, lax.shift_right_arithmetic]
    alone = [lax.neg, lax.bitwise_not, jnp.abs, lax.sign, lax.square, lambda x: lax.integer_pow(x, 3), jnp.sum]
    signed, unsigned = (jnp.dtype(f"{kind}{8 * a.dtype.itemsize}") for kind in ("int", "uint"))
    row = jnp.arange(5, dtype=a.dtype)
    return {
        "alone": [operation(a) for operation in alone],
        "both": [operation(a, b) for operation in both],
        "compared": [lax.shift_left(a, b) > 1, lax.neg(a) > b, lax.bitwise_not(a) > b, lax.add(a, b) > b],
        "product": a @ b,
        "bits": [lax.bitcast_convert_type(a, kind) < 5 for kind in (signed, unsigned)],
        "kinds": [a.astype(kind) for kind in ("int8", "uint16", "int32", "uint32", "float32")],
        "indexed": [lax.dynamic_slice(row, (a[0],), (2,)), row.at[a].get(mode="clip"), row.at[a].get(mode="fill")],
    }


def the_same(function, *arguments, flags=SANITIZED):
    """Whether a program's results are JAX's to the bit, signs of zeros too."""
    results = CompiledProgram(translate(function, *arguments, name="tried"), flags)(*arguments)
    for result, wanted in zip(results, jax.tree.leaves(jax.jit(function)(*arguments)), strict=True):
        np.testing.assert_array_equal(result, wanted)
        np.testing.assert_array_equal(np.signbit(result), np.signbit(wanted))


@needs_gcc
@pytest.mark.parametrize("kind", ["int8", "int16", "int32", "uint8", "uint16", "uint32"])
def test_integer_edge_cases_match_jax(kind):
    """Division by zero, sums that do not fit, shifts by more than there are bits."""
    least, most = np.iinfo(kind).min, np.iinfo(kind).max
    numbers = [most, least, least + 1, 0, 1, 2, 3, 7, 8, 15, 16, 31, 32, 40, *([-1, -2, -8] if least else [most - 1])]
    pairs = np.array([*itertools.product(numbers, numbers)], kind)
    the_same(ends, pairs[:, 0], pairs[:, 1], flags=(*SANITIZED, "-Wno-type-limits", "-Wno-sign-compare"))


@needs_gcc
def test_casts_saturate_and_signed_zeros_match_jax():
    powers = 2.0 ** np.array([7, 8, 15, 16, 31, 32, 100])
    x = np.array([np.nan, np.inf, 0, 0.5, 127.5, 255.9, 300, *powers, *(powers - 1)], np.float32)
    kinds = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "bool")
    the_same(lambda x: {"kinds": [y.astype(kind) for kind in kinds for y in (x, -x)]}, x)
    zeros, others = np.array([[0.0, -0.0, 0, -0.0], [-0.0, 0.0, 0, -0.0]], np.float32)
    the_same(
        lambda x, y: [lax.max(x, y), lax.min(x, y), jnp.maximum(x, 0), x.max(), x.min(), x[1:].max()], zeros, others
    )


@needs_gcc
def test_short_internal_names_are_free_for_arguments():
    def act(k1, a1, s1, i1, p1, r1, long_1, time):
        sums = jnp.cumsum(s1) + A[0] * k1 + long(a1, i1)[0] + p1 * r1
        return {"s2": sums @ sums, "k2": jnp.sin(sums) + A[1], "i2": long_1 + time, "time": time}

    given = [X + number for number in range(8)]
    results = CompiledProgram(translate(act, *given, name="a2"), STRICT)(*given)
    for result, wanted in zip(results, jax.tree.leaves(act(*given)), strict=True):
        np.testing.assert_allclose(result, wanted, rtol=2e-6)


@pytest.mark.parametrize(
    ("function", "needle"),
    [
        (jnp.sort, "primitive 'sort'"),
        (lambda x: x.astype(jnp.float16).sum(), "kind 'float16'"),
        (lambda x: lax.bitcast_convert_type(x, jnp.uint8), "'bitcast_convert_type' cannot be translated: float32"),
        (lambda x: lax.pad(x, 0.0, ((-1, 0, 0),)), "'pad' cannot be translated: by less than nothing"),
    ],
)
def test_untranslatable_primitives_are_refused_with_their_source_line(function, needle):
    with pytest.raises(Unsupported, match=needle) as refused:
        translate(lambda x: function(x), X)
    assert "line unknown" not in str(refused.value)
    assert "test_translator.py" in str(refused.value)
