"""When a render ends: samples, seconds, error, together or alone.

Who looks at a noisy number again and again, and stops when it pleases, is deceived by it: the first look below the
asked error is below it by luck. Three things hold that off.

Looks are few and fixed beforehand: at 2^k and 3 * 2^(k-1) samples, where the sequence is well spread and its parts
comparable. What is compared is the error by the whole curve (its rate is fitted over all looks), with room for several
looks' luck: the surer the estimate, the nearer to the asked error it aims. And the end is not the first look that
pleases: as soon as the curve says that the aim lies before the next look, the number of samples is settled, and what is
traced then was not asked its opinion (two stages, Stein 1945). Were the picture to end where it looks best, it would end
before its bright paths are found: research on other engines found 1 to 3 % of the light missing.

Decisions are taken by the whole picture, never by a pixel: a pixel that missed a bright path claims to be done.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from luch.curve import Curve

FIRST_LOOK = 8  # samples; fewer say nothing of the rate
LEAST_SAMPLES = 16  # before an error can end a render: what a sixteenth of the samples meet should be met once
LOOKS_LUCK = 2.2  # standard deviations that the luckiest of a few looks lies away, in 19 of 20 renders
MOST_OVER = 1.1  # of the asked error: the true one may be as large
NEAREST_AIM, FARTHEST_AIM = 0.97, 0.87  # of the asked error
LAST_DIGITS = 8  # the last number of samples has so many steps between two powers of two: well spread, little wasted
# Samples where an error is asked and samples are not.
UNLIMITED_SAMPLES = 1 << 16
# Settings.quality: steps of one dial (luch.quality) and the errors that they ask for. At 10 % grain is plain to see, at
# 2 % it is seen in flat parts alone; a reference is for comparing.
CUSTOM = "CUSTOM"  # the other settings hold
STEPS = {"DRAFT": 0.2, "PREVIEW": 0.1, "GOOD": 0.05, "HIGH": 0.02, "REFERENCE": 0.005}


def looks_after(samples: int) -> int:
    """The next of 8, 12, 16, 24, 32, 48, ... samples."""
    power = FIRST_LOOK
    while True:
        if power > samples:
            return power
        if power + power // 2 > samples:
            return power + power // 2
        power *= 2


def rounded_up(samples: float) -> int:
    """To a number of few binary digits: 101 -> 104."""
    exponent = math.floor(math.log2(max(1.0, samples)))
    step = 1 << max(0, exponent - int(math.log2(LAST_DIGITS)))
    return math.ceil(samples / step) * step


@dataclass
class Stopping:
    """samples: of every pixel, at most. error: asked, as a fraction; 0: none.

    >>> stopping = Stopping(samples=4096, error=0.02)
    >>> stopping.next_look(8)
    12
    """

    samples: int
    error: float = 0.0
    settled: int = 0  # samples at which the error asked for will be reached; 0: not known yet
    reached: bool = False

    def next_look(self, done: int) -> int:
        """How many samples the next steps go to, at most."""
        ahead = min(looks_after(done), self.samples)
        return min(ahead, self.settled) if self.settled > done else ahead

    def aim(self, spread: float) -> float:
        """The error to go for, surely enough for an estimate whose logarithm has that standard deviation."""
        room = MOST_OVER * math.exp(-LOOKS_LUCK * spread)
        return self.error * min(NEAREST_AIM, max(FARTHEST_AIM, room))

    def ask(self, error: float, curve: Curve) -> None:
        """For another error from now on, which the picture may have reached already, or no more."""
        self.error, self.settled, self.reached = error, 0, False
        self.look(curve)

    def look(self, curve: Curve) -> bool:
        """Whether the error asked for is reached. To be called after every point of the curve."""
        found = curve.last
        if not self.error > 0.0 or found is None:
            return False
        done = curve.points[-1][0]
        if done < LEAST_SAMPLES:
            return False
        aim = self.aim(found.spread)
        if found.error <= aim or (done == self.settled and found.error <= self.error):
            self.reached = True
            return True
        needed = rounded_up(done + curve.forecast(aim).samples)
        self.settled = needed if needed <= looks_after(done) else 0
        return False
