"""Native FMUs: models traced to C, the runtime that serves them, and their compilation for every platform."""
