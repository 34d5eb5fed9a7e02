"""Whole numbers and switches: counts its steps, tells odd ones, shows what comes in."""

from pythonfmu import Boolean, Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Integer, Real, String


class Switchboard(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.steps = 0
        self.odd = False
        self.number_in = 0
        self.switch_in = False
        self.number_seen = 0
        self.switch_seen = False
        self.enabled = True
        self.label = "none"
        self.level = 0.0
        discrete = {"variability": Fmi2Variability.discrete}
        shown = {"causality": Fmi2Causality.output, "initial": Fmi2Initial.calculated, **discrete}
        fixed = {
            "causality": Fmi2Causality.parameter,
            "variability": Fmi2Variability.fixed,
            "initial": Fmi2Initial.exact,
        }
        self.register_variable(Boolean("odd", **shown))
        self.register_variable(Integer("steps", **shown))
        self.register_variable(Integer("number_seen", **shown))
        self.register_variable(Boolean("switch_seen", **shown))
        self.register_variable(Real("level", causality=Fmi2Causality.output, initial=Fmi2Initial.calculated))
        self.register_variable(Integer("number_in", causality=Fmi2Causality.input, **discrete))
        self.register_variable(Boolean("switch_in", causality=Fmi2Causality.input, **discrete))
        self.register_variable(Boolean("enabled", **fixed))
        self.register_variable(String("label", **fixed))

    def do_step(self, current_time, step_size):
        self.steps += 1
        self.odd = self.steps % 2 == 1
        self.level = 0.5 * self.steps
        self.number_seen = self.number_in
        self.switch_seen = self.switch_in
        return True
