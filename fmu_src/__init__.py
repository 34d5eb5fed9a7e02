"""How a model becomes an FMU.

At build: `catalogue` lists the models, `sources` gathers their Python files, `interface` turns their records into FMI
variables, `description` and `documentation` write them down (`units`, `wording`), `assemble` makes one FMU, `build`
is the way in (`build_messages` tells of it).
The native kind: `trace` calls the model with symbols, `native` writes that as C and compiles it with its runtime.
The Python kind: in the FMU `slave` runs the model, with `ports`, `saved_state` and `failure`; they import pythonfmu and
models only.
"""
