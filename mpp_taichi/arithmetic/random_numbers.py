"""Random numbers of a counter: the same number for the same counter, on every device and in any order.

Philox4x32 with ten rounds makes four words of 32 bits from a counter of four words and a key of two. There is no state to be
stored: a number depends on its counter alone, such as the particle and the step, and on its key, the seed. Hence it is the
same however a run is cut, and on any number of threads. Source: Salmon, Moraes, Dror & Shaw, "Parallel random numbers: as easy
as 1, 2, 3", Proc. SC11 (2011), which gives the multipliers and the increments of the key below.
"""

import math

import taichi as ti
from taichi.math import uvec2, uvec4

from mpp_taichi.types import Template

ROUNDS = 10
MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
KEY_STEPS = (0x9E3779B9, 0xBB67AE85)
SPACING = 2.0**-32


@ti.func
def random_words(counter: uvec4, key: uvec2) -> uvec4:
    """Philox4x32-10: four words for a counter and a key."""
    words, own = counter, key
    for _ in ti.static(range(ROUNDS)):
        first, second = ti.u32(MULTIPLIERS[0]), ti.u32(MULTIPLIERS[1])
        upper = high_word(first, words[0]), high_word(second, words[2])
        lower = first * words[0], second * words[2]
        words = uvec4(upper[1] ^ words[1] ^ own[0], lower[1], upper[0] ^ words[3] ^ own[1], lower[0])
        own += uvec2(ti.u32(KEY_STEPS[0]), ti.u32(KEY_STEPS[1]))
    return words


@ti.func
def high_word(a: ti.u32, b: ti.u32) -> ti.u32:
    """The upper 32 bits of the product of two words; not every device has integers of 64 bits."""
    half, ones = ti.u32(16), ti.u32(0xFFFF)
    a_low, a_high, b_low, b_high = a & ones, a >> half, b & ones, b >> half
    middle = a_high * b_low + ((a_low * b_low) >> half)
    other = a_low * b_high + (middle & ones)
    return a_high * b_high + (middle >> half) + (other >> half)


@ti.func
def share_of(word: ti.u32) -> ti.f32:
    """A number between 0 and 1, both left out up to the rounding of f32, uniform: (word + ½) / 2³²."""
    return (ti.cast(word, ti.f32) + ti.f32(0.5)) * ti.f32(SPACING)


@ti.func
def normal_numbers(words: uvec4):
    """Four independent numbers of mean 0 and variance 1 in f32, normal up to 6.66.

    Source: Box & Muller, Ann. Math. Stat. 29 (1958) 610. Vulkan has logarithms and sines in f32 only, and noise
    needs no more digits.
    """
    result = ti.Vector.zero(ti.f32, 4)
    for pair in ti.static(range(2)):
        # The largest word is rounded to a share of 1, whose logarithm is 0.
        radius = ti.sqrt(ti.f32(-2.0) * ti.log(ti.min(share_of(words[2 * pair]), ti.f32(1.0))))
        angle = ti.f32(2.0 * math.pi) * share_of(words[2 * pair + 1])
        result[2 * pair], result[2 * pair + 1] = radius * ti.cos(angle), radius * ti.sin(angle)
    return result


@ti.func
def normals_for(particle, step, seed: Template):
    """Four independent normal numbers of a particle in a step; `seed` is a whole number below 2³²."""
    counter = uvec4(ti.cast(particle, ti.u32), ti.cast(step, ti.u32), ti.u32(0), ti.u32(0))
    return normal_numbers(random_words(counter, uvec2(ti.u32(seed), ti.u32(0))))


@ti.func
def bits_of(number):
    """The bits of a number in f32, as a word of a counter."""
    return ti.bit_cast(ti.cast(number, ti.f32), ti.u32)
