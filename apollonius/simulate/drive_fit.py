"""The model of a drive fitted to a record by least squares: parameters, their errors, and which
limits the record shows.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from math import exp, inf, log, sqrt

import numpy as np
import scipy  # its parts are loaded where they are used
from jaxtyping import Float, Int

from apollonius.simulate.channel import ChannelLimits, Commands, channel_response
from apollonius.simulate.drive_record import DriveRecord

CHANNELS = ("speed", "turn_rate")
LIMITS = tuple(limit.name for limit in fields(ChannelLimits))
DELAYS = ("latency", "lag")
PARAMETERS = (*DELAYS, *(f"{channel} {limit}" for channel in CHANNELS for limit in LIMITS))
"""Names of the parameters: delays [s], which both channels share, and limits."""
_SMALLEST = 1e-3
_LARGEST = 1e3
"""Bounds of limits."""
_LONGEST = 1.5
"""Bound of delays [s]."""
_SIGNIFICANT = 15.0
"""Growth of the sum of squares, in variances of a residual, that shows a limit: about four standard
errors.
"""
QUANTILE = 2.2
"""Of Student's t with ten degrees of freedom, 95 %: a drive has about ten manoeuvres of a kind.
"""
_MARGIN = 1.05
"""A limit shows only where commands exceed it by so much: a drive may be slow by less."""
_BLOCK = 2.0
"""Residuals further apart are taken as independent [s]."""

_LONGEST_CORRELATION = 1000
"""Of residuals [samples]."""

Parameters = Mapping[str, float]


@dataclass(frozen=True)
class _Stretch:
    """Commands of a channel and the values measured during them, with their numbers in the
    record.
    """

    commands: Commands
    samples: slice
    times: Float[np.ndarray, " samples"]
    values: Float[np.ndarray, " samples"]


def _stretches(record: DriveRecord, channel: str) -> list[_Stretch]:
    commanded = getattr(record, f"command_{channel}")
    measured = getattr(record, channel)
    stretches: list[_Stretch] = []
    for commands, samples in record.stretches():
        times = record.command_times[commands]
        before = (record.times > times[0] - 0.3) & (record.times <= times[0])
        at_start = measured[before] if before.any() else measured[samples][:3]
        stretches.append(
            _Stretch(
                Commands(times, commanded[commands], float(np.median(at_start))),
                samples,
                record.times[samples],
                measured[samples],
            )
        )
    return stretches


@dataclass(frozen=True)
class DriveFit:
    """Parameters that explain a record; infinity stands for no limit.

    Attributes:
        record: what was recorded.
        parameters: the value of each parameter.
        scales: standard deviations of the residuals of each channel.
    """

    record: DriveRecord
    parameters: Parameters
    scales: Mapping[str, float]
    _stretches: Mapping[str, list[_Stretch]] = field(repr=False)

    @classmethod
    def start(cls, record: DriveRecord) -> "DriveFit":
        """Return a first guess: limits from quantiles, delays from a grid."""
        stretches = {channel: _stretches(record, channel) for channel in CHANNELS}
        scales: dict[str, float] = {}
        limits: dict[str, float] = {}
        for channel in CHANNELS:
            measured = getattr(record, channel)
            scales[channel] = max(float(np.std(measured)) / 10, 1e-6)
            quantiles = _first_limits(record.times, measured)
            limits |= {f"{channel} {name}": value for name, value in quantiles.items()}
        guesses = [
            cls(record, limits | {"latency": latency, "lag": lag}, scales, stretches)
            for latency in np.arange(0, 0.8, 0.05).tolist()
            for lag in (0.03, 0.1, 0.3)
        ]
        return min(guesses, key=lambda guess: guess.cost)

    def _residuals(self, channel: str, parameters: Parameters) -> Float[np.ndarray, " samples"]:
        """Return the residuals of a channel [standard deviations]."""
        limits = ChannelLimits(**{name: parameters[f"{channel} {name}"] for name in LIMITS})
        latency = parameters["latency"]
        lag = parameters["lag"]
        parts = [
            channel_response(stretch.commands, limits, lag, stretch.times - latency)
            - stretch.values
            for stretch in self._stretches[channel]
        ]
        return np.concatenate(parts) / self.scales[channel]

    @property
    def samples(self) -> Int[np.ndarray, " samples"]:
        """The numbers of the odometries that are explained."""
        of_stretches = [
            np.arange(len(self.record.times))[stretch.samples]
            for stretch in self._stretches["speed"]
        ]
        return np.concatenate(of_stretches)

    @cached_property
    def residuals(self) -> dict[str, Float[np.ndarray, " samples"]]:
        """The residuals of each channel [standard deviations]."""
        return {channel: self._residuals(channel, self.parameters) for channel in CHANNELS}

    @cached_property
    def cost(self) -> float:
        """Sum of the squares of all residuals."""
        return float(sum(np.sum(part**2) for part in self.residuals.values()))

    @property
    def free(self) -> tuple[str, ...]:
        """The parameters with a finite value."""
        return tuple(name for name in PARAMETERS if self.parameters[name] < inf)

    def model(self, channel: str) -> Float[np.ndarray, " samples"]:
        """Compute the model's values of a channel at the explained odometries."""
        measured = getattr(self.record, channel)[self.samples]
        return measured + self.residuals[channel] * self.scales[channel]

    def _vector(self, names: Collection[str]) -> Float[np.ndarray, " parameters"]:
        """Return parameters as the optimiser has them: logarithms of limits."""
        values = self.parameters
        return np.array([values[name] if name in DELAYS else log(values[name]) for name in names])

    def _with_vector(
        self, names: Collection[str], vector: Float[np.ndarray, " parameters"]
    ) -> dict[str, float]:
        values = zip(names, vector.tolist(), strict=True)
        new = {name: value if name in DELAYS else exp(value) for name, value in values}
        return {**self.parameters, **new}

    def jacobian(self, names: Collection[str]) -> Float[np.ndarray, "residuals parameters"]:
        """Return the derivatives of all residuals by delays and logarithms of limits."""
        vector = self._vector(names)
        columns = np.zeros((len(vector), len(CHANNELS), len(self.samples)))
        for row, name in enumerate(names):
            step = 1e-6
            moved = vector.copy()
            moved[row] += step
            parameters = self._with_vector(names, moved)
            for place, channel in enumerate(CHANNELS):
                if name in DELAYS or name.startswith(channel):
                    change = self._residuals(channel, parameters) - self.residuals[channel]
                    columns[row, place] = change / step
        return columns.reshape(len(vector), -1).T

    def refit(self, fixed: Collection[str] = (), tolerance: float = 1e-6) -> "DriveFit":
        """Return the best fit from here on.

        Args:
            fixed: Parameters that stay as they are, as those without a finite value do.
            tolerance: Change of the cost, relative to it, at which the search ends.
        """
        names = [name for name in self.free if name not in fixed]
        lowest = np.array([0.0 if name in DELAYS else log(_SMALLEST) for name in names])
        highest = np.array([_LONGEST if name in DELAYS else log(_LARGEST) for name in names])

        def at(vector: Float[np.ndarray, " parameters"]) -> DriveFit:
            return self.with_parameters(self._with_vector(names, vector))

        solution = scipy.optimize.least_squares(
            lambda vector: np.concatenate([*at(vector).residuals.values()]),
            np.clip(self._vector(names), lowest + 1e-9, highest - 1e-9),
            lambda vector: at(vector).jacobian(names),
            bounds=(lowest, highest),
            x_scale=np.array([0.02 if name in DELAYS else 0.1 for name in names]),
            tr_solver="lsmr",  # without decompositions, whose threads thwart each other
            ftol=tolerance,
            xtol=1e-6,
            max_nfev=50,
        )
        return at(solution.x)

    def with_parameters(self, parameters: Parameters) -> "DriveFit":
        return DriveFit(self.record, parameters, self.scales, self._stretches)

    def reweighted(self) -> "DriveFit":
        """Weight each channel by the residuals that it has."""
        scales = {
            channel: max(self.scales[channel] * float(np.std(part)), 1e-6)
            for channel, part in self.residuals.items()
        }
        return DriveFit(self.record, self.parameters, scales, self._stretches)

    @cached_property
    def inflation(self) -> float:
        """By how much correlated residuals enlarge the variance of a mean, at least 1."""
        return max(1.0, *(correlation_time(part) for part in self.residuals.values()))

    def with_fixed(self, name: str, value: float) -> "DriveFit":
        """Return the best fit in which a parameter has this value; infinity for no limit."""
        changed = self.with_parameters({**self.parameters, name: value})
        return changed.refit(fixed=(name,), tolerance=1e-4)

    def is_shown(self, name: str) -> bool:
        """Check whether the record shows a limit: commands exceed it, and without it the record is
        explained worse.
        """
        channel, limit = name.split()
        commanded = getattr(self.record, f"command_{channel}")
        largest = {"highest": commanded.max(), "lowest": -commanded.min()}.get(limit, inf)
        if largest < _MARGIN * self.parameters[name]:
            return False
        threshold = self.cost + _SIGNIFICANT * self.inflation
        at_once = self.with_parameters({**self.parameters, name: inf})
        return at_once.cost > threshold and self.with_fixed(name, inf).cost > threshold

    def is_possible(self, name: str, value: float) -> bool:
        """Check whether a value of a parameter explains the record hardly worse than the best."""
        cost = self.with_fixed(name, value).cost
        return cost < self.cost + QUANTILE**2 * self.inflation

    def least_possible(self, name: str) -> float:
        """Return the least value of a limit that the record does not show, to 3 %; 0 for any."""
        low, high = log(_SMALLEST), log(_LARGEST)
        while high - low > 0.03:
            middle = (low + high) / 2
            is_possible = self.is_possible(name, exp(middle))
            low, high = (low, middle) if is_possible else (middle, high)
        return exp(high) if low > log(_SMALLEST) else 0.0

    def furthest_delay(self, name: str, reach: float, furthest: float) -> float:
        """Return the least or greatest value of a delay [s] by its standard error, or by its
        profile where that reaches further, to a millisecond.

        Args:
            name: the delay.
            reach: difference from the best value by the standard error, of either sign.
            furthest: difference beyond which no value is tried.
        """
        best = self.parameters[name]
        near, far = max(best + reach, 0.0), max(best + furthest, 0.0)
        if far == near or not self.is_possible(name, near):
            return near
        while abs(far - near) > 0.001:
            middle = (near + far) / 2
            is_possible = self.is_possible(name, middle)
            near, far = (middle, far) if is_possible else (near, middle)
        return far

    @cached_property
    def standard_errors(self) -> dict[str, float]:
        """The standard errors of delays [s] and of logarithms of limits.

        The larger of two: that of Gauss and Newton, inflated by the correlation of residuals, and
        that of scores summed over blocks of time, which also sees larger errors in manoeuvres.
        """
        names = self.free
        jacobian = self.jacobian(names)
        bread = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12, hermitian=True)
        times = self.record.times[self.samples]
        blocks = np.floor((times - times[0]) / _BLOCK).astype(int)
        residuals = np.concatenate([*self.residuals.values()])
        scores = np.zeros((blocks[-1] + 1, len(names)))
        np.add.at(scores, np.tile(blocks, len(CHANNELS)), jacobian * residuals[:, None])
        used = len(np.unique(blocks))
        correction = used / max(used - len(names), 1)
        by_blocks = bread @ (scores.T @ scores) @ bread * correction
        by_newton = bread * self.inflation * self.cost / len(residuals)
        variances = np.maximum(np.diag(by_blocks), np.diag(by_newton))
        variances = np.maximum(variances, 0.0)  # which rounding can miss
        return {name: sqrt(value) for name, value in zip(names, variances.tolist(), strict=True)}


def correlation_time(values: Float[np.ndarray, " samples"]) -> float:
    """Return 1 + 2 * the sum of autocorrelations, up to the first within two standard errors of 0
    [samples].
    """
    centred = values - values.mean()
    power = float(centred @ centred)
    total = 1.0
    for lag in range(1, min(len(values) // 4, _LONGEST_CORRELATION)):
        correlation = float(centred[lag:] @ centred[:-lag]) / power if power else 0.0
        if correlation <= 2 / sqrt(len(values)):
            break
        total += 2 * correlation
    return total


def _first_limits(
    times: Float[np.ndarray, " samples"], values: Float[np.ndarray, " samples"]
) -> dict[str, float]:
    """Return a first guess of the limits of a channel, rather too low than too high: where a limit
    is so high that it never holds, no derivative leads back.
    """
    grid = np.arange(times[0], times[-1], 0.1)
    averaged = np.convolve(np.pad(values, 3, mode="edge"), np.ones(7) / 7, "valid")
    smooth = np.interp(grid, times, averaged)
    slopes = (smooth[3:] - smooth[:-3]) / 0.3
    away = slopes * np.sign(smooth[3:] + smooth[:-3])
    return {
        "highest": max(float(np.quantile(values, 0.95)), 0.01),
        "lowest": max(-float(np.quantile(values, 0.05)), 0.01),
        "rise": max(0.8 * float(np.quantile(away, 0.97)), 0.01),
        "fall": max(-0.8 * float(np.quantile(away, 0.03)), 0.01),
    }


def fit_drive(record: DriveRecord) -> DriveFit:
    """Return the best fit with those limits alone that the record shows.

    Limits that explain nothing are dropped one after the other, the least telling first.
    """
    fit = DriveFit.start(record).refit().reweighted().refit().reweighted()
    while True:
        hidden = [name for name in fit.free if name not in DELAYS and not fit.is_shown(name)]
        if not hidden:
            return fit
        fit = min((fit.with_fixed(name, inf) for name in hidden), key=lambda other: other.cost)
