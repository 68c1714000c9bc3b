//! Drives on which the program once misled, and plants for them.

pub const BELT_REFUSED: &str = r#"[actuator]
mass = 0.8
force_constant = 25.0
current_limit = 5.0
[encoder]
resolution = 10e-6
counter_bits = 16
[[load]]
mass = 1.5
stiffness = 40e3
damping = 8.0
[[load]]
mass = 0.4
stiffness = 9e3
damping = 2.0
[control]
sample_time = 1e-3
disturbance_cutoff = 628.0
reaction_force_cutoff = 628.0
observer = "anchored"
[cost]
current = 1.0
settling_time = 0.06
[move]
velocity = 0.5
acceleration = 10.0
jerk = 200.0
"#;

pub const BELT_2A: &str = r#"[actuator]
mass = 1.040257
force_constant = 25.0
current_limit = 2.0
current_resolution = 1e-3
[encoder]
resolution = 10e-6
counter_bits = 16
[[load]]
mass = 1.949835
stiffness = 32000.07
damping = 8.001947
[[load]]
mass = 0.5200468
stiffness = 7200.51
damping = 1.999852
[control]
sample_time = 1e-3
disturbance_cutoff = 628.0
reaction_force_cutoff = 628.0
observer = "anchored"
[cost]
current = 1.0
settling_time = 0.2
[move]
velocity = 0.5
acceleration = 10.0
jerk = 200.0
[friction]
viscous = 2.975529
coulomb = 2.00326
"#;

pub const BELT_2A_PLANT: &str = r"[actuator]
mass = 1.04
force_constant = 25.0
current_limit = 2.0
current_resolution = 1e-3
[encoder]
resolution = 10e-6
counter_bits = 16
[[load]]
mass = 1.95
stiffness = 32e3
damping = 8.0
[[load]]
mass = 0.52
stiffness = 7.2e3
damping = 2.0
[friction]
coulomb = 2.0
viscous = 3.0
";

pub const ROTARY: &str = r#"kind = "rotary"
[actuator]
mass = 0.00007802031
force_constant = 0.11
current_limit = 2.0
current_resolution = 1e-3
[encoder]
resolution = 3.834951969714103e-4
counter_bits = 16
[[load]]
mass = 0.0005203294
stiffness = 5.201025
damping = 0.001995003
[control]
sample_time = 1e-3
disturbance_cutoff = 628.0
reaction_force_cutoff = 628.0
observer = "anchored"
[cost]
current = 1.0
settling_time = 0.12
[friction]
viscous = 0.0001074994
coulomb = 0.004990798
"#;

pub const ROTARY_PLANT: &str = r#"kind = "rotary"
[actuator]
mass = 7.8e-5
force_constant = 0.11
current_limit = 2.0
current_resolution = 1e-3
[encoder]
resolution = 3.834951969714103e-4
counter_bits = 16
[[load]]
mass = 5.2e-4
stiffness = 5.2
damping = 0.002
[friction]
coulomb = 0.005
viscous = 1e-4
"#;

pub const HEAVY: &str = r#"[actuator]
mass = 0.3
force_constant = 20.0
current_limit = 2.0
current_resolution = 1e-3
[encoder]
resolution = 5e-6
counter_bits = 16
[[load]]
mass = 1.8
stiffness = 8000.0
damping = 3.0
[control]
sample_time = 1e-3
disturbance_cutoff = 628.0
reaction_force_cutoff = 628.0
observer = "anchored"
[cost]
current = 1.0
position = [225.0, 225.0]
velocity = [0.2, 0.2]
"#;

pub const HEAVY_PLANT: &str = r"[actuator]
mass = 0.39
force_constant = 20.0
current_limit = 2.0
current_resolution = 1e-3
[encoder]
resolution = 5e-6
counter_bits = 16
[[load]]
mass = 2.34
stiffness = 6400.0
damping = 3.0
[friction]
coulomb = 1.0
viscous = 2.0
";

pub const HUNTING: &str = r#"[actuator]
mass=1.51619
force_constant=0.538199
current_limit=1496.84
current_resolution=0
[encoder]
resolution=2.03637e-07
counter_bits=32
[[load]]
mass=0.178578
stiffness=14339
damping=15.4611
[[load]]
mass=5.86798
stiffness=21649
damping=53.7102
[[load]]
mass=1.359
stiffness=110532
damping=94.6834
[control]
sample_time=0.001
disturbance_cutoff=357.345
reaction_force_cutoff=357.345
observer="anchored"
[friction]
coulomb=11.5805
viscous=0.02963
[cost]
current=1
settling_time=0.413265
"#;

pub const HUNTING_WILD: &str = r#"[actuator]
mass=1.27583
force_constant=0.271753
current_limit=4995.2
current_resolution=12.2288
[encoder]
resolution=1.12974e-06
counter_bits=32
[[load]]
mass=6.57059
stiffness=1129.45
damping=16.5016
[[load]]
mass=1.48207
stiffness=200289
damping=51.7738
[[load]]
mass=9.88149
stiffness=49871.2
damping=202.129
[control]
sample_time=0.001
disturbance_cutoff=871.395
reaction_force_cutoff=435.697
observer="anchored"
[friction]
coulomb=62.1426
viscous=1.76146
[cost]
current=1
position=[1.79828e+08, 1.79828e+08, 1.79828e+08, 1.79828e+08]
velocity=[429947, 429947, 429947, 429947]
[observer]
design="poles"
speed=3.11
"#;
