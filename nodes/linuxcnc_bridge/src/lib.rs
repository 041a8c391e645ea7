//! LinuxCNC behind the same boundary as the fake machine.
