"""y = k u + c, evaluated at the end of a step with the input held over it; also at initialisation."""

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real


class Gain(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.k = -1.0
        self.c = 0.0
        self.u = 0.0
        self.initialising = True
        self.held = 0.0
        fixed = {
            "causality": Fmi2Causality.parameter,
            "variability": Fmi2Variability.fixed,
            "initial": Fmi2Initial.exact,
        }
        self.register_variable(Real("k", **fixed))
        self.register_variable(Real("c", **fixed))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(
            Real("y", causality=Fmi2Causality.output, initial=Fmi2Initial.calculated, getter=self.output)
        )

    def value(self):
        return self.k * self.u + self.c

    def output(self):
        return self.value() if self.initialising else self.held

    def exit_initialization_mode(self):
        self.held = self.value()
        self.initialising = False

    def do_step(self, current_time, step_size):
        self.held = self.value()
        return True
