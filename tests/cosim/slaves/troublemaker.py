"""Goes wrong in a chosen way at a chosen time: 0 not at all, 1 raises, 2 discards, 3 warns, 4 kills the process,
5 never comes back, 6 gives NaN, 7 refuses to start, 8 raises after a while.
"""

import os
import time

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Integer, Real
from pythonfmu.enums import Fmi2Status


class Troublemaker(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.way = 0
        self.when = 0.5
        self.y = 0.0
        self.exited = 0
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}
        self.register_variable(Integer("way", initial=Fmi2Initial.exact, **fixed))
        self.register_variable(Real("when", initial=Fmi2Initial.exact, **fixed))
        self.register_variable(Real("y", causality=Fmi2Causality.output, initial=Fmi2Initial.calculated))

        shown = {"causality": Fmi2Causality.output, "initial": Fmi2Initial.calculated}
        self.register_variable(Integer("exited", variability=Fmi2Variability.discrete, **shown))

    def exit_initialization_mode(self):
        self.exited = 1
        if self.way == 7:
            raise ValueError("no bearing")

    def do_step(self, current_time, step_size):
        self.y = current_time + step_size
        if self.way and self.y > self.when + 1e-9:
            return self.misbehave()
        return True

    def misbehave(self):
        if self.way == 8:
            time.sleep(1.5)
        if self.way in (1, 8):
            self.log("the bearing has seized at 100%% load", Fmi2Status.error, "logStatusError")
            raise ValueError("seized")
        if self.way == 2:
            self.log("step too long", Fmi2Status.discard, "logStatusDiscard")
            return False
        if self.way == 3:
            self.log("running warm", Fmi2Status.warning, "logStatusWarning")
            self.way = 0
        if self.way == 4:
            os._exit(139)
        if self.way == 5:
            time.sleep(1e4)
        if self.way == 6:
            self.y = float("nan")
        return True
