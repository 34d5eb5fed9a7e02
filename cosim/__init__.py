"""How FMUs are put together, run and looked at.

=================  =================================================================================
`system`           a coupled system: components, connections, parameter values; says whether it can run
`ssp`              the same as files: ``.ssp`` archives and ``.ssv`` parameter sets
`interface`        what an FMU offers: variables, types, units
`master`           `simulate`: couples the FMUs and records them
`span`             the communication points of a run
`slave`            one FMU that takes part in a run
`interrupts`       Ctrl-C and progress during a run
`workspace`        folders for unpacked FMUs; files written whole or not at all
`recording`        results on disk while a run goes on, and as FMPy writes them
`jobs`             several runs at a time, each in a process of its own
`devices`          sensors of the market as parameter sets
`scenarios`        ready-made systems by name
`run`              a run as the command makes it: files and numbers
`info`             what can be set and recorded, as a list
`report`           the numbers of a run
`plot`             the picture of a run
`recorded_motion`  recordings of real motion fed to an ideal sensor
`identification`   noise models from records: AR(1) fit, power spectrum, cross-correlation
`allan`            Allan deviation of a record, and of the terms of noise in theory
`bench`            drives one sensor FMU and reads its registers, fast
`multisine`        signals of many sines, and the spectra of what answers them
`characteristics`  what a sensor does, measured: noise, responses, calibration, temperature, codes
`filter_claims`    what the datasheets say of the parts' digital filters
`sheet_claims`     what the datasheets print as codes and random walks
`sensor`           a sensor measured as the command does it
`sensor_findings`  all that is measured of a device
`sensor_report`    the table of datasheet and modelled part
`sensor_plot`      the pictures of a part
`control`          models and FMUs as python-control's systems, and such systems as FMUs
`command_line`     the command ``attitude-fmu``
=================  =================================================================================
"""
