"""dx/dt = u + drive, exact for an input held over the step."""

from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real


class Integrator(Fmi2Slave):
    description = "integrator"
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=1.0, step_size=0.01)

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = 0.0
        self.x0 = 0.0
        self.drive = 0.0
        self.x = 0.0
        self.last_time = 0.0
        for name in ("x0", "drive"):
            self.register_variable(
                Real(
                    name,
                    causality=Fmi2Causality.parameter,
                    variability=Fmi2Variability.fixed,
                    initial=Fmi2Initial.exact,
                )
            )
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        for name in ("x", "last_time"):
            self.register_variable(Real(name, causality=Fmi2Causality.output, initial=Fmi2Initial.calculated))

    def enter_initialization_mode(self):
        self.x = self.x0

    def do_step(self, current_time, step_size):
        self.last_time = current_time
        self.x += step_size * (self.u + self.drive)
        return True
