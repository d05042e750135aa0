"""A budget of a study for tests that need no clock."""

from mpp_taichi.accuracy.budget import Budget


class CountedBudget(Budget):
    """A budget that ends after so many questions, whatever the clock says; each takes a second, or a part of `seconds`."""

    def __init__(self, asks, seconds=None):
        super().__init__(asks if seconds is None else seconds)
        self.asked, self.asks = 0, asks

    @property
    def spent(self):
        return self.seconds * self.asked / self.asks

    def check(self):
        self.asked += 1
        super().check()
