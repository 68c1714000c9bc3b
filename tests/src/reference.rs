//! Reference implementation of the control corridor and of the plant, in plain `f64`.
//!
//! An oracle for tests: written from the equations alone, sharing no code with the control
//! core, and spelled out for reading rather than for speed. Every dynamic element that has a
//! held input is discretised with one matrix exponential; nothing is rearranged to save work.
//!
//! Units are SI throughout. The state order is `x_a v_a x_1 v_1 … x_n v_n`, actuator first,
//! then the loads from the actuator outwards. Spring and damper `j` join load `j` to its
//! neighbour on the actuator's side. The reaction force is positive when the load holds the
//! actuator back: `f_reac = k_1 (x_a - x_1) + c_1 (v_a - v_1)`.

type Matrix = Vec<Vec<f64>>;

/// A drive as the controller knows it: actuator, encoder, chain of loads, sampling, cutoffs.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceDrive {
    /// Nominal mass of the actuator, `m_an`, kg.
    pub actuator_mass: f64,
    /// Nominal force constant, `k_fn`, N/A.
    pub force_constant: f64,
    /// Identified deviation of the actuator's mass from nominal, actual minus nominal, kg.
    pub mass_deviation: f64,
    /// Identified deviation of the force constant, actual minus nominal, N/A.
    pub force_constant_deviation: f64,
    /// Largest magnitude of the current command, A; a multiple of `current_resolution`.
    pub current_limit: f64,
    /// Step of the current output, A; zero for a continuous output.
    pub current_resolution: f64,
    /// Distance per encoder count, m.
    pub encoder_resolution: f64,
    /// Width of the encoder counter, 1 to 32 bits.
    pub counter_bits: u32,
    /// Mass of each load, from the actuator outwards, kg.
    pub load_mass: Vec<f64>,
    /// Stiffness of the spring between each load and its neighbour towards the actuator, N/m.
    pub stiffness: Vec<f64>,
    /// Damping beside each spring, N s/m.
    pub damping: Vec<f64>,
    /// Control period, s.
    pub sample_time: f64,
    /// Cutoff of the disturbance observer, `g_dist`, rad/s.
    pub disturbance_cutoff: f64,
    /// Cutoff of the reaction-force observer, `g_reac`, rad/s.
    pub reaction_force_cutoff: f64,
}

impl ReferenceDrive {
    /// Number of loads.
    ///
    /// # Panics
    /// When there is no load, when the lists of the loads differ in length, or when the
    /// counter's width is outside 1 to 32 bits.
    #[must_use]
    pub fn loads(&self) -> usize {
        let loads = self.load_mass.len();
        assert!(loads > 0, "a drive has at least one load");
        assert_eq!(self.stiffness.len(), loads, "one stiffness per load");
        assert_eq!(self.damping.len(), loads, "one damping per load");
        assert!(
            (1..=32).contains(&self.counter_bits),
            "a counter has 1 to 32 bits"
        );
        loads
    }

    /// System matrix of the free chain for the given mass of the actuator.
    fn chain(&self, actuator_mass: f64) -> Matrix {
        let loads = self.loads();
        let mut mass = vec![actuator_mass];
        mass.extend(&self.load_mass);
        let mut a = zeros(2 * loads + 2, 2 * loads + 2);
        for element in 0..=loads {
            a[2 * element][2 * element + 1] = 1.0;
        }
        for outer in 1..=loads {
            let inner = outer - 1;
            let (k, c) = (self.stiffness[inner], self.damping[inner]);
            // The force k (x_inner - x_outer) + c (v_inner - v_outer) pushes the outer mass
            // forwards and holds the inner one back.
            for (element, sign) in [(outer, 1.0), (inner, -1.0)] {
                let row = &mut a[2 * element + 1];
                let m = mass[element];
                row[2 * inner] += sign * k / m;
                row[2 * inner + 1] += sign * c / m;
                row[2 * outer] -= sign * k / m;
                row[2 * outer + 1] -= sign * c / m;
            }
        }
        a
    }

    /// System matrix and input vector of the anchored load: states `r_1 v_1 … r_n v_n q_1 q_2 d`
    /// with `r_j = x_j - x_a`, input `v_a`.
    fn anchored_load(&self) -> (Matrix, Vec<f64>) {
        let loads = self.loads();
        let (q1, q2, d) = (2 * loads, 2 * loads + 1, 2 * loads + 2);
        let mut a = zeros(2 * loads + 3, 2 * loads + 3);
        let mut b = vec![0.0; 2 * loads + 3];
        for j in 0..loads {
            let (r, v) = (2 * j, 2 * j + 1);
            a[r][v] = 1.0;
            b[r] = -1.0;
            let (k, c, m) = (self.stiffness[j], self.damping[j], self.load_mass[j]);
            a[v][r] -= k / m;
            a[v][v] -= c / m;
            if j == 0 {
                // The actuator is at r = 0 and moves with v_a.
                b[v] += c / m;
            } else {
                let inner_mass = self.load_mass[j - 1];
                a[v][r - 2] += k / m;
                a[v][v - 2] += c / m;
                a[v - 2][r] += k / inner_mass;
                a[v - 2][v] += c / inner_mass;
                a[v - 2][r - 2] -= k / inner_mass;
                a[v - 2][v - 2] -= c / inner_mass;
            }
        }
        // f_reac = -k_1 r_1 + c_1 (v_a - v_1), seen with d through the two lags.
        let g_dist = self.disturbance_cutoff;
        a[q1][0] = -g_dist * self.stiffness[0];
        a[q1][1] = -g_dist * self.damping[0];
        b[q1] = g_dist * self.damping[0];
        a[q1][d] = g_dist;
        a[q1][q1] = -g_dist;
        let g_reac = self.reaction_force_cutoff;
        a[q2][q1] = g_reac;
        a[q2][q2] = -g_reac;
        (a, b)
    }
}

/// Gains, designed elsewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceGains {
    /// Regulator gain K, order `x_a v_a x_1 v_1 …`, A/m and A s/m.
    pub regulator: Vec<f64>,
    /// Observer gain L, applied to the force innovation after the prediction. Order
    /// `r_1 v_1 … r_n v_n q_1 q_2 d` for [`ReferenceObserver::Anchored`],
    /// `x_a v_a x_1 v_1 …` for [`ReferenceObserver::Reaction`].
    pub observer_gain: Vec<f64>,
}

/// Which state observer the controller runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceObserver {
    /// The load alone, driven by the measured motion of the actuator, with the lags of the
    /// force observers and a disturbance on the actuator as further states.
    Anchored,
    /// Eq. (17): the whole free chain, driven by the current.
    Reaction,
}

/// What one step of the controller found and commands.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceOutput {
    /// Measured position of the actuator, m.
    pub position: f64,
    /// Disturbance estimate, eq. (19) alone, N.
    pub disturbance: f64,
    /// Reaction-force estimate, eq. (18), N.
    pub reaction_force: f64,
    /// Estimated state in the regulator's order, absolute positions, m and m/s.
    pub estimate: Vec<f64>,
    /// Disturbance state `d` of the anchored observer, N; zero for the reaction observer.
    pub disturbance_state: f64,
    /// Command before limiting and rounding, A; may be non-finite when the inputs are.
    pub unlimited_current: f64,
    /// Command, A: limited, rounded to the output's resolution, zero when not finite.
    pub current: f64,
}

/// The control corridor: encoder, force observers, state observer, regulator, limiter.
#[derive(Clone, Debug)]
pub struct ReferenceController {
    drive: ReferenceDrive,
    gains: ReferenceGains,
    observer: ReferenceObserver,
    /// Transition matrix and input vector of the observer's prediction over one period.
    transition: Matrix,
    input: Vec<f64>,
    /// Everything that changes from step to step; none before the first.
    memory: Option<Memory>,
}

#[derive(Clone, Debug)]
struct Memory {
    encoder: Encoder,
    start_position: f64,
    last_position: f64,
    forces: Forces,
    state: Vec<f64>,
}

impl ReferenceController {
    /// A controller that starts with the first call of [`step`](Self::step).
    ///
    /// # Panics
    /// When a gain does not fit the number of loads.
    #[must_use]
    pub fn new(
        drive: &ReferenceDrive,
        gains: &ReferenceGains,
        observer: ReferenceObserver,
    ) -> Self {
        let loads = drive.loads();
        assert_eq!(gains.regulator.len(), 2 * loads + 2, "length of K");
        let (a, b) = match observer {
            ReferenceObserver::Anchored => drive.anchored_load(),
            ReferenceObserver::Reaction => {
                let mut b = vec![0.0; 2 * loads + 2];
                let mass = drive.actuator_mass + drive.mass_deviation;
                b[1] = (drive.force_constant + drive.force_constant_deviation) / mass;
                (drive.chain(mass), b)
            }
        };
        assert_eq!(gains.observer_gain.len(), b.len(), "length of L");
        let (transition, input) = zero_order_hold(&a, &b, drive.sample_time);
        Self {
            drive: drive.clone(),
            gains: gains.clone(),
            observer,
            transition,
            input,
            memory: None,
        }
    }

    /// One control period.
    ///
    /// * `raw_count`: the encoder counter as read, modulo its width; the first reading is
    ///   taken as a signed number (two's complement), so that 0 is 0 m
    /// * `applied_current`: what flowed over the period that ends now, A
    /// * `reference`: target of every mass, m
    ///
    /// The first call also initialises: filters at rest, every mass at the measured position,
    /// all velocities and forces zero.
    pub fn step(
        &mut self,
        raw_count: u32,
        applied_current: f64,
        reference: f64,
    ) -> ReferenceOutput {
        let drive = &self.drive;
        let loads = drive.loads();
        let memory = self
            .memory
            .get_or_insert_with(|| Memory::start(drive, self.observer, raw_count));

        // Encoder.
        let position = memory.encoder.count(raw_count) * drive.encoder_resolution;
        let mean_velocity = (position - memory.last_position) / drive.sample_time;
        memory.last_position = position;

        // Forces.
        let displacement = position - memory.start_position;
        let forces = memory.forces.step(displacement, applied_current);

        // State observer: predict, then correct with the force innovation.
        let held_input = match self.observer {
            ReferenceObserver::Anchored => mean_velocity,
            ReferenceObserver::Reaction => applied_current,
        };
        let predicted = add(
            &mat_vec(&self.transition, &memory.state),
            &scaled(&self.input, held_input),
        );
        let predicted_force = match self.observer {
            ReferenceObserver::Anchored => predicted[2 * loads + 1],
            ReferenceObserver::Reaction => {
                drive.stiffness[0] * (predicted[0] - predicted[2])
                    + drive.damping[0] * (predicted[1] - predicted[3])
            }
        };
        let innovation = forces.reaction_force - predicted_force;
        memory.state = add(&predicted, &scaled(&self.gains.observer_gain, innovation));

        let (estimate, disturbance_state) = match self.observer {
            ReferenceObserver::Anchored => {
                let mut estimate = vec![position, forces.velocity];
                for load in memory.state[..2 * loads].chunks(2) {
                    estimate.push(load[0] + position);
                    estimate.push(load[1]);
                }
                (estimate, memory.state[2 * loads + 2])
            }
            ReferenceObserver::Reaction => (memory.state.clone(), 0.0),
        };

        // Regulator: every mass to the reference, every velocity to zero.
        let mut error = estimate.clone();
        for element in error.iter_mut().step_by(2) {
            *element -= reference;
        }
        let unlimited_current = disturbance_state
            / (drive.force_constant + drive.force_constant_deviation)
            - dot(&self.gains.regulator, &error);

        ReferenceOutput {
            position,
            disturbance: forces.disturbance,
            reaction_force: forces.reaction_force,
            estimate,
            disturbance_state,
            unlimited_current,
            current: limited(drive, unlimited_current),
        }
    }
}

impl Memory {
    fn start(drive: &ReferenceDrive, observer: ReferenceObserver, raw_count: u32) -> Self {
        let loads = drive.loads();
        let encoder = Encoder::new(drive.counter_bits, raw_count);
        let position = encoder.total as f64 * drive.encoder_resolution;
        let state = match observer {
            ReferenceObserver::Anchored => vec![0.0; 2 * loads + 3],
            ReferenceObserver::Reaction => {
                let mut state = vec![0.0; 2 * loads + 2];
                for element in state.iter_mut().step_by(2) {
                    *element = position;
                }
                state
            }
        };
        Self {
            encoder,
            start_position: position,
            last_position: position,
            forces: Forces::new(drive),
            state,
        }
    }
}

/// Command to the current output: limited, then rounded half away from zero.
fn limited(drive: &ReferenceDrive, current: f64) -> f64 {
    if !current.is_finite() {
        return 0.0;
    }
    let clamped = current.clamp(-drive.current_limit, drive.current_limit);
    if drive.current_resolution > 0.0 {
        (clamped / drive.current_resolution).round() * drive.current_resolution
    } else {
        clamped
    }
}

/// Unwraps the counter of an encoder.
#[derive(Clone, Debug)]
struct Encoder {
    bits: u32,
    last: u32,
    total: i64,
}

impl Encoder {
    fn new(bits: u32, raw: u32) -> Self {
        Self {
            bits,
            last: raw,
            total: signed(i64::from(raw), bits),
        }
    }

    /// Position in counts; exact, because a total of counts stays far below 2^53.
    fn count(&mut self, raw: u32) -> f64 {
        self.total += signed(i64::from(raw) - i64::from(self.last), self.bits);
        self.last = raw;
        self.total as f64
    }
}

/// The lowest `bits` of a number, read as two's complement.
fn signed(number: i64, bits: u32) -> i64 {
    let modulus = 1_i64 << bits;
    let remainder = number.rem_euclid(modulus);
    if remainder < modulus / 2 {
        remainder
    } else {
        remainder - modulus
    }
}

/// Disturbance observer (19) and reaction-force observer (18).
#[derive(Clone, Debug)]
struct Forces {
    drive: ReferenceDrive,
    last_displacement: f64,
    /// Both lags in a row on `k_fn i`.
    current_path: TwoLags,
    /// The first and the second of the filtered differences in a row.
    velocity: FilteredDifference,
    acceleration: FilteredDifference,
    /// Eq. (19) alone.
    disturbance_current: Lag,
    disturbance_acceleration: FilteredDifference,
    /// Deviation terms of (18), which are filtered once, with `g_reac`.
    deviation_current: Lag,
    deviation_acceleration: FilteredDifference,
}

struct ForceEstimates {
    disturbance: f64,
    reaction_force: f64,
    /// Velocity of the actuator behind the first filtered difference.
    velocity: f64,
}

impl Forces {
    fn new(drive: &ReferenceDrive) -> Self {
        let (g_dist, g_reac) = (drive.disturbance_cutoff, drive.reaction_force_cutoff);
        let period = drive.sample_time;
        Self {
            drive: drive.clone(),
            last_displacement: 0.0,
            current_path: TwoLags::new(g_dist, g_reac, period),
            velocity: FilteredDifference::new(g_dist, period),
            acceleration: FilteredDifference::new(g_reac, period),
            disturbance_current: Lag::new(g_dist, period),
            disturbance_acceleration: FilteredDifference::new(g_dist, period),
            deviation_current: Lag::new(g_reac, period),
            deviation_acceleration: FilteredDifference::new(g_reac, period),
        }
    }

    fn step(&mut self, displacement: f64, current: f64) -> ForceEstimates {
        let drive = &self.drive;
        let raw_velocity = (displacement - self.last_displacement) / drive.sample_time;
        self.last_displacement = displacement;
        let nominal_force = drive.force_constant * current;

        let disturbance = self.disturbance_current.step(nominal_force)
            - drive.actuator_mass * self.disturbance_acceleration.step(raw_velocity);

        let velocity = self.velocity.step(displacement);
        let twice_filtered = self.current_path.step(nominal_force)
            - drive.actuator_mass * self.acceleration.step(velocity);
        let deviation = self
            .deviation_current
            .step(drive.force_constant_deviation * current)
            - drive.mass_deviation * self.deviation_acceleration.step(raw_velocity);

        ForceEstimates {
            disturbance,
            reaction_force: twice_filtered + deviation,
            velocity,
        }
    }
}

/// First-order lag `g / (s + g)`, exact for an input held over the period.
#[derive(Clone, Debug)]
struct Lag {
    decay: f64,
    output: f64,
}

impl Lag {
    fn new(cutoff: f64, period: f64) -> Self {
        Self {
            decay: (-cutoff * period).exp(),
            output: 0.0,
        }
    }

    fn step(&mut self, held_input: f64) -> f64 {
        self.output = self.decay * self.output + (1.0 - self.decay) * held_input;
        self.output
    }
}

/// Two first-order lags in a row, exact for an input held over the period.
#[derive(Clone, Debug)]
struct TwoLags {
    transition: Matrix,
    input: Vec<f64>,
    state: Vec<f64>,
}

impl TwoLags {
    fn new(first: f64, second: f64, period: f64) -> Self {
        let a = vec![vec![-first, 0.0], vec![second, -second]];
        let (transition, input) = zero_order_hold(&a, &[first, 0.0], period);
        Self {
            transition,
            input,
            state: vec![0.0, 0.0],
        }
    }

    fn step(&mut self, held_input: f64) -> f64 {
        self.state = add(
            &mat_vec(&self.transition, &self.state),
            &scaled(&self.input, held_input),
        );
        self.state[1]
    }
}

/// Filtered derivative `g s / (s + g)`: `v = a v' + (1 - a) (x - x') / T`, `a = exp(-g T)`,
/// primes for the sample before.
#[derive(Clone, Debug)]
struct FilteredDifference {
    lag: Lag,
    period: f64,
    last: f64,
}

impl FilteredDifference {
    fn new(cutoff: f64, period: f64) -> Self {
        Self {
            lag: Lag::new(cutoff, period),
            period,
            last: 0.0,
        }
    }

    fn step(&mut self, value: f64) -> f64 {
        let slope = (value - self.last) / self.period;
        self.last = value;
        self.lag.step(slope)
    }
}

/// The real drive: a frictionless chain moved by the actuator's force, with an encoder.
///
/// Mass of the actuator and force constant are the actual ones, nominal plus deviation.
#[derive(Clone, Debug)]
pub struct ReferencePlant {
    /// State `x_a v_a x_1 v_1 …`, m and m/s.
    pub state: Vec<f64>,
    drive: ReferenceDrive,
    /// The last step length used, with its transition matrix and input vector.
    discretised: Option<(f64, Matrix, Vec<f64>)>,
}

impl ReferencePlant {
    /// A plant in the given state.
    ///
    /// # Panics
    /// When the state does not fit the number of loads.
    #[must_use]
    pub fn new(drive: &ReferenceDrive, initial_state: &[f64]) -> Self {
        assert_eq!(
            initial_state.len(),
            2 * drive.loads() + 2,
            "length of state"
        );
        Self {
            state: initial_state.to_vec(),
            drive: drive.clone(),
            discretised: None,
        }
    }

    /// Moves on by `duration` seconds in `substeps` equal, exact steps under a held current.
    pub fn advance(&mut self, current: f64, duration: f64, substeps: usize) {
        let step = duration / substeps as f64;
        let (transition, input) = match self.discretised.take() {
            Some((known, transition, input)) if known == step => (transition, input),
            _ => {
                let mass = self.drive.actuator_mass + self.drive.mass_deviation;
                let force_constant =
                    self.drive.force_constant + self.drive.force_constant_deviation;
                let mut b = vec![0.0; self.state.len()];
                b[1] = force_constant / mass;
                zero_order_hold(&self.drive.chain(mass), &b, step)
            }
        };
        for _ in 0..substeps {
            self.state = add(&mat_vec(&transition, &self.state), &scaled(&input, current));
        }
        self.discretised = Some((step, transition, input));
    }

    /// The encoder's counter: position rounded to whole counts, half away from zero, then
    /// wrapped to the counter's width.
    #[must_use]
    pub fn count(&self) -> u32 {
        let count = (self.state[0] / self.drive.encoder_resolution).round() as i64;
        count.rem_euclid(1_i64 << self.drive.counter_bits) as u32
    }
}

/// One control period of a closed loop.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceSample {
    /// Encoder counter at the start of the period.
    pub count: u32,
    /// Current over the period before, A; zero for the first.
    pub applied_current: f64,
    /// What the controller made of it; its `current` acts over the period that follows.
    pub output: ReferenceOutput,
    /// True state at the start of the period, `x_a v_a x_1 v_1 …`.
    pub plant_state: Vec<f64>,
}

/// Controller and plant in closed loop for `steps` periods, both built from the same drive.
#[must_use]
pub fn closed_loop(
    drive: &ReferenceDrive,
    gains: &ReferenceGains,
    observer: ReferenceObserver,
    reference: f64,
    initial_state: &[f64],
    steps: usize,
) -> Vec<ReferenceSample> {
    const SUBSTEPS: usize = 20;
    let mut controller = ReferenceController::new(drive, gains, observer);
    let mut plant = ReferencePlant::new(drive, initial_state);
    let mut applied_current = 0.0;
    let mut samples = Vec::with_capacity(steps);
    for _ in 0..steps {
        let count = plant.count();
        let output = controller.step(count, applied_current, reference);
        let commanded = output.current;
        samples.push(ReferenceSample {
            count,
            applied_current,
            output,
            plant_state: plant.state.clone(),
        });
        plant.advance(commanded, drive.sample_time, SUBSTEPS);
        applied_current = commanded;
    }
    samples
}

/// Discrete `F` and `G` of `dx/dt = A x + B u` for an input held over `period`: the two upper
/// blocks of `exp([A B; 0 0] period)`.
fn zero_order_hold(a: &Matrix, b: &[f64], period: f64) -> (Matrix, Vec<f64>) {
    let n = b.len();
    let mut augmented = zeros(n + 1, n + 1);
    for row in 0..n {
        for column in 0..n {
            augmented[row][column] = a[row][column] * period;
        }
        augmented[row][n] = b[row] * period;
    }
    let e = exponential(&augmented);
    let transition = (0..n).map(|row| e[row][..n].to_vec()).collect();
    let input = (0..n).map(|row| e[row][n]).collect();
    (transition, input)
}

/// Matrix exponential: Taylor series of the matrix halved until its norm is below 1/2, then
/// squared as often. Twenty terms leave a remainder below 0.5^21 / 21!, less than 1e-25.
fn exponential(matrix: &Matrix) -> Matrix {
    let n = matrix.len();
    let norm = matrix
        .iter()
        .map(|row| row.iter().map(|x| x.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    assert!(norm.is_finite(), "a finite matrix");
    let mut squarings = 0;
    let mut scale = 1.0;
    while norm * scale > 0.5 {
        scale *= 0.5;
        squarings += 1;
    }
    let small: Matrix = matrix.iter().map(|row| scaled(row, scale)).collect();

    let mut term = zeros(n, n);
    for (i, row) in term.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    let mut sum = term.clone();
    for order in 1..=20 {
        term = mat_mul(&term, &small)
            .iter()
            .map(|row| scaled(row, 1.0 / f64::from(order)))
            .collect();
        sum = sum.iter().zip(&term).map(|(s, t)| add(s, t)).collect();
    }
    for _ in 0..squarings {
        sum = mat_mul(&sum, &sum);
    }
    sum
}

fn zeros(rows: usize, columns: usize) -> Matrix {
    vec![vec![0.0; columns]; rows]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn add(a: &[f64], b: &[f64]) -> Vec<f64> {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(x, y)| x + y).collect()
}

fn scaled(vector: &[f64], factor: f64) -> Vec<f64> {
    vector.iter().map(|x| x * factor).collect()
}

fn mat_vec(matrix: &Matrix, vector: &[f64]) -> Vec<f64> {
    matrix.iter().map(|row| dot(row, vector)).collect()
}

fn mat_mul(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = b[0].len();
    a.iter()
        .map(|row| {
            (0..columns)
                .map(|j| row.iter().zip(b).map(|(x, b_row)| x * b_row[j]).sum())
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Sampled-data LQR for [`rig`]: weights 225 and 0.2 for every mass, current 1.
    const REGULATOR: [f64; 8] = [
        59.3959, 1.1318, -26.5573, 0.0565, -6.9015, 0.1581, 2.2091, 0.2127,
    ];
    /// Stationary Kalman gain for [`rig`]: force noise 0.3 N/sqrt(Hz) on each load, random
    /// walk 9.5 N/sqrt(s) of the disturbance, 1 N rms on every force sample.
    const ANCHORED: [f64; 9] = [
        -0.0020838139166390614,
        -0.47141323280984415,
        -0.0029763919378509073,
        -0.0486281193660595,
        -0.0025546349337898715,
        -0.11783386262941609,
        0.6634555153880942,
        0.45086727564663326,
        0.22261902068981781,
    ];

    fn rig() -> ReferenceDrive {
        ReferenceDrive {
            actuator_mass: 0.059,
            force_constant: 6.43,
            mass_deviation: 0.0,
            force_constant_deviation: 0.0,
            current_limit: 2.0,
            current_resolution: 1e-3,
            encoder_resolution: 1e-6,
            counter_bits: 16,
            load_mass: vec![0.019; 3],
            stiffness: vec![300.0; 3],
            damping: vec![0.1; 3],
            sample_time: 1e-3,
            disturbance_cutoff: 628.0,
            reaction_force_cutoff: 628.0,
        }
    }

    /// Every parameter its own, so that a swapped index shows.
    fn mixed() -> ReferenceDrive {
        ReferenceDrive {
            actuator_mass: 0.05,
            load_mass: vec![0.02, 0.03, 0.045],
            stiffness: vec![400.0, 250.0, 600.0],
            damping: vec![0.2, 0.05, 0.4],
            disturbance_cutoff: 500.0,
            reaction_force_cutoff: 900.0,
            ..rig()
        }
    }

    /// One load on the actuator.
    fn two_masses(damping: f64) -> ReferenceDrive {
        ReferenceDrive {
            load_mass: vec![0.03],
            stiffness: vec![200.0],
            damping: vec![damping],
            disturbance_cutoff: 500.0,
            reaction_force_cutoff: 900.0,
            ..rig()
        }
    }

    fn rig_gains() -> ReferenceGains {
        ReferenceGains {
            regulator: REGULATOR.to_vec(),
            observer_gain: ANCHORED.to_vec(),
        }
    }

    /// No feedback, no correction.
    fn zero_gains(drive: &ReferenceDrive, observer: ReferenceObserver) -> ReferenceGains {
        let states = 2 * drive.loads() + 2;
        ReferenceGains {
            regulator: vec![0.0; states],
            observer_gain: match observer {
                ReferenceObserver::Anchored => vec![0.0; states + 1],
                ReferenceObserver::Reaction => vec![0.0; states],
            },
        }
    }

    #[track_caller]
    fn assert_close(actual: f64, expected: f64, tolerance: f64) {
        assert!(
            (actual - expected).abs() <= tolerance,
            "{actual} is not within {tolerance} of {expected}"
        );
    }

    #[track_caller]
    fn assert_all_close(actual: &[f64], expected: &[f64], tolerance: f64) {
        assert_eq!(actual.len(), expected.len());
        for (a, e) in actual.iter().zip(expected) {
            assert_close(*a, *e, tolerance);
        }
    }

    /// Integral of `f` from 0 to `end`, Simpson's rule.
    fn integral(end: f64, f: impl Fn(f64) -> f64) -> f64 {
        let pieces = 2000;
        let h = end / f64::from(pieces);
        let weighted: f64 = (0..=pieces)
            .map(|i| {
                let weight = match i {
                    0 => 1.0,
                    _ if i == pieces => 1.0,
                    _ if i % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                weight * f(f64::from(i) * h)
            })
            .sum();
        weighted * h / 3.0
    }

    // Arithmetic.

    #[test]
    fn exponential_of_known_matrices() {
        // Rotation, also far beyond the radius where the bare series would do.
        for angle in [0.3, 2.0, 40.0_f64] {
            let e = exponential(&vec![vec![0.0, -angle], vec![angle, 0.0]]);
            assert_all_close(&e[0], &[angle.cos(), -angle.sin()], 1e-13);
            assert_all_close(&e[1], &[angle.sin(), angle.cos()], 1e-13);
        }
        // Nilpotent, triangular with distinct and with equal eigenvalues.
        let e = exponential(&vec![vec![0.0, 7.0], vec![0.0, 0.0]]);
        assert_all_close(&e.concat(), &[1.0, 7.0, 0.0, 1.0], 1e-14);
        let e = exponential(&vec![vec![-1.0, 3.0], vec![0.0, -4.0]]);
        let (p, q) = ((-1.0_f64).exp(), (-4.0_f64).exp());
        assert_all_close(&e.concat(), &[p, p - q, 0.0, q], 1e-15);
        let e = exponential(&vec![vec![-5.0, 5.0], vec![0.0, -5.0]]);
        let p = (-5.0_f64).exp();
        assert_all_close(&e.concat(), &[p, 5.0 * p, 0.0, p], 1e-16);
    }

    #[test]
    fn held_input_of_a_double_integrator() {
        let a = vec![vec![0.0, 1.0], vec![0.0, 0.0]];
        let (f, g) = zero_order_hold(&a, &[0.0, 2.0], 0.1);
        assert_all_close(&f.concat(), &[1.0, 0.1, 0.0, 1.0], 1e-15);
        assert_all_close(&g, &[0.01, 0.2], 1e-16);
    }

    // Encoder.

    #[test]
    fn encoder_starts_signed_and_unwraps() {
        for (bits, raw, start) in [
            (16, 0, 0.0),
            (16, 5, 5.0),
            (16, 0xFFFF, -1.0),
            (16, 0x8000, -32768.0),
            (32, 0xFFFF_FFFE, -2.0),
            (8, 0x7F, 127.0),
        ] {
            assert_eq!(Encoder::new(bits, raw).count(raw), start);
        }
        for bits in [8, 16, 32] {
            let modulus = 1_i64 << bits;
            let stride = modulus / 2 - 1;
            for direction in [1, -1] {
                let mut encoder = Encoder::new(bits, 3);
                for step in 1..20 {
                    let truth = 3 + direction * stride * step;
                    let raw = u32::try_from(truth.rem_euclid(modulus)).unwrap();
                    assert_eq!(encoder.count(raw), truth as f64);
                }
            }
        }
    }

    #[test]
    fn plant_counts_round_half_away_from_zero_and_wrap() {
        let drive = ReferenceDrive {
            encoder_resolution: 0.5,
            ..rig()
        };
        for (position, count) in [
            (0.0, 0),
            (0.2, 0),
            (0.25, 1),
            (0.74, 1),
            (-0.25, 65535),
            (-0.2, 0),
            (16384.0, 32768),
            (32768.0, 0),
            (-32768.5, 65535),
        ] {
            let mut state = vec![0.0; 8];
            state[0] = position;
            assert_eq!(ReferencePlant::new(&drive, &state).count(), count);
        }
    }

    #[test]
    fn a_narrow_counter_changes_nothing() {
        // 110 mm, so that 16 bits of 1 um wrap on the way.
        let run = |bits| {
            let drive = ReferenceDrive {
                counter_bits: bits,
                ..rig()
            };
            let observer = ReferenceObserver::Anchored;
            closed_loop(&drive, &rig_gains(), observer, 0.11, &[0.0; 8], 400)
        };
        let (narrow, wide) = (run(16), run(32));
        assert!(narrow.iter().zip(&wide).any(|(n, w)| n.count != w.count));
        for (n, w) in narrow.iter().zip(&wide) {
            assert_eq!(n.output, w.output);
            assert_eq!(n.plant_state, w.plant_state);
        }
        assert_close(narrow[399].output.position, 0.11, 1e-3);
    }

    // Force observers.

    #[test]
    fn lags_answer_a_held_current_exactly() {
        // A blocked actuator: the forces are the lagged current alone.
        for (g1, g2) in [(628.0, 628.0), (500.0, 900.0), (900.0, 500.0)] {
            let mut drive = rig();
            drive.disturbance_cutoff = g1;
            drive.reaction_force_cutoff = g2;
            let mut forces = Forces::new(&drive);
            let current = 0.7;
            let force = drive.force_constant * current;
            for k in 1..=10 {
                let t = f64::from(k) * drive.sample_time;
                let out = forces.step(0.0, current);
                assert_close(out.disturbance, force * (1.0 - (-g1 * t).exp()), 1e-13);
                let remaining = if g1 == g2 {
                    (1.0 + g1 * t) * (-g1 * t).exp()
                } else {
                    (g2 * (-g1 * t).exp() - g1 * (-g2 * t).exp()) / (g2 - g1)
                };
                assert_close(out.reaction_force, force * (1.0 - remaining), 1e-13);
            }
        }
    }

    #[test]
    fn deviation_of_the_force_constant_is_filtered_once() {
        let mut drive = mixed();
        drive.force_constant = 0.0;
        drive.force_constant_deviation = 0.5;
        let mut forces = Forces::new(&drive);
        for k in 1..=10 {
            let t = f64::from(k) * drive.sample_time;
            let out = forces.step(0.0, 2.0);
            let expected = 1.0 - (-drive.reaction_force_cutoff * t).exp();
            assert_close(out.reaction_force, expected, 1e-14);
            assert_eq!(out.disturbance, 0.0);
        }
    }

    #[test]
    fn deviation_of_the_mass_is_filtered_once() {
        let mut drive = mixed();
        drive.actuator_mass = 0.0;
        drive.mass_deviation = 0.01;
        let mut forces = Forces::new(&drive);
        // A step of 1 um: the difference quotient is a pulse up, then one down.
        let decay = (-drive.reaction_force_cutoff * drive.sample_time).exp();
        let pulse = 1e-6 / drive.sample_time.powi(2) * (1.0 - decay) * drive.mass_deviation;
        let first = forces.step(1e-6, 0.0).reaction_force;
        let second = forces.step(1e-6, 0.0).reaction_force;
        assert_close(first, -pulse, 1e-15);
        assert_close(second, pulse - decay * pulse, 1e-15);
    }

    #[test]
    fn constant_acceleration_gives_mass_times_acceleration() {
        let drive = mixed();
        let acceleration = 3.0;
        let mut forces = Forces::new(&drive);
        let mut last = forces.step(0.0, 0.0);
        for k in 1..=100 {
            let t = f64::from(k) * drive.sample_time;
            last = forces.step(0.5 * acceleration * t * t, 0.0);
        }
        let expected = -drive.actuator_mass * acceleration;
        assert_close(last.disturbance, expected, 1e-10);
        assert_close(last.reaction_force, expected, 1e-10);
        // The velocity lags a ramp by half a period for the mean and, at the end of each
        // period, by T a / (1 - a) for the filter, a being its decay.
        let decay = (-drive.disturbance_cutoff * drive.sample_time).exp();
        let lag = drive.sample_time * (0.5 + decay / (1.0 - decay));
        assert_close(last.velocity, acceleration * (0.1 - lag), 1e-12);
    }

    #[test]
    fn position_path_matches_the_continuous_filter_at_the_modes() {
        // Tolerances well under the errors of the usual discretisations (28 % and 27 degrees
        // at 12 Hz).
        let mut drive = rig();
        drive.actuator_mass = 1.0;
        for (frequency, gain_tolerance, degrees) in
            [(12.0, 0.003, 0.5), (26.0, 0.01, 1.5), (36.0, 0.02, 2.5)]
        {
            let omega = 2.0 * PI * frequency;
            let mut forces = Forces::new(&drive);
            let (mut cosine, mut sine) = (0.0, 0.0);
            for k in 0..2000 {
                let phase = omega * f64::from(k) * drive.sample_time;
                let force = -forces.step(phase.sin(), 0.0).reaction_force;
                if k >= 1000 {
                    // One second holds a whole number of periods.
                    cosine += force * phase.cos() / 500.0;
                    sine += force * phase.sin() / 500.0;
                }
            }
            let lag = (omega / drive.disturbance_cutoff).atan();
            let gain = (omega * lag.cos()).powi(2);
            assert_close(cosine.hypot(sine) / gain, 1.0, gain_tolerance);
            // Inertia force opposes the position, then lags twice.
            let phase = cosine.atan2(sine).rem_euclid(2.0 * PI);
            assert_close(phase, PI - 2.0 * lag, f64::to_radians(degrees));
        }
    }

    #[test]
    fn identified_deviations_remove_the_nominal_error() {
        // The whole chain under constant acceleration, springs already stretched: the reaction
        // force is the loads' mass times the acceleration.
        let mut drive = mixed();
        drive.mass_deviation = 0.008;
        drive.force_constant_deviation = -0.6;
        drive.encoder_resolution = 1e-9;
        drive.counter_bits = 32;
        let current = 0.2;
        let acceleration = (drive.force_constant + drive.force_constant_deviation) * current
            / (drive.actuator_mass + drive.mass_deviation + 0.095);
        let mut plant = ReferencePlant::new(&drive, &stretched(&drive, acceleration));
        let observer = ReferenceObserver::Anchored;
        let gains = zero_gains(&drive, observer);
        let mut controller = ReferenceController::new(&drive, &gains, observer);
        let mut output = controller.step(plant.count(), 0.0, 0.0);
        for _ in 0..100 {
            plant.advance(current, drive.sample_time, 20);
            output = controller.step(plant.count(), current, 0.0);
        }
        assert_close(output.reaction_force, 0.095 * acceleration, 2e-4);
        let nominal = drive.force_constant * current - drive.actuator_mass * acceleration;
        assert_close(output.disturbance, nominal, 2e-4);
    }

    // Plant.

    /// State at rest in which every spring already carries what lies beyond it.
    fn stretched(drive: &ReferenceDrive, acceleration: f64) -> Vec<f64> {
        let mut state = vec![0.0, 0.0];
        for load in 0..drive.loads() {
            let beyond: f64 = drive.load_mass[load..].iter().sum();
            let inner = state[2 * load];
            state.push(inner - beyond * acceleration / drive.stiffness[load]);
            state.push(0.0);
        }
        state
    }

    fn energy(drive: &ReferenceDrive, state: &[f64]) -> f64 {
        let mut energy = 0.5 * drive.actuator_mass * state[1].powi(2);
        for load in 0..drive.loads() {
            let deflection = state[2 * load + 2] - state[2 * load];
            energy += 0.5 * drive.load_mass[load] * state[2 * load + 3].powi(2)
                + 0.5 * drive.stiffness[load] * deflection.powi(2);
        }
        energy
    }

    const DISTURBED: [f64; 8] = [0.001, -0.02, 0.004, 0.05, -0.003, 0.01, 0.002, -0.04];

    #[test]
    fn undamped_chain_keeps_its_energy() {
        let drive = ReferenceDrive {
            damping: vec![0.0; 3],
            ..mixed()
        };
        let mut plant = ReferencePlant::new(&drive, &DISTURBED);
        let before = energy(&drive, &plant.state);
        let mut last = plant.state.clone();
        for _ in 0..1000 {
            plant.advance(0.0, drive.sample_time, 20);
            let change = energy(&drive, &plant.state) / before - 1.0;
            assert!(change.abs() < 1e-10, "{change}");
            assert_ne!(plant.state, last);
            last.clone_from(&plant.state);
        }
    }

    #[test]
    fn dampers_take_what_the_energy_loses() {
        let drive = mixed();
        let mut plant = ReferencePlant::new(&drive, &DISTURBED);
        let before = energy(&drive, &plant.state);
        let power = |state: &[f64]| -> f64 {
            (0..3)
                .map(|j| drive.damping[j] * (state[2 * j + 3] - state[2 * j + 1]).powi(2))
                .sum()
        };
        let (step, mut dissipated) = (2e-5, 0.0);
        for _ in 0..5000 {
            let start = power(&plant.state);
            plant.advance(0.0, step, 1);
            dissipated += 0.5 * step * (start + power(&plant.state));
        }
        assert!(dissipated > 0.3 * before);
        assert_close(
            energy(&drive, &plant.state) + dissipated,
            before,
            1e-5 * before,
        );
    }

    #[test]
    fn centre_of_mass_sees_only_the_current() {
        let drive = mixed();
        let mut plant = ReferencePlant::new(&drive, &DISTURBED);
        let mut mass = vec![drive.actuator_mass];
        mass.extend(&drive.load_mass);
        let total: f64 = mass.iter().sum();
        let centre = |state: &[f64], part: usize| -> f64 {
            (0..4).map(|e| mass[e] * state[2 * e + part]).sum::<f64>() / total
        };
        let (x, v) = (centre(&DISTURBED, 0), centre(&DISTURBED, 1));
        let current = -0.4;
        let acceleration = drive.force_constant * current / total;
        for k in 1..=500 {
            plant.advance(current, drive.sample_time, 20);
            let t = f64::from(k) * drive.sample_time;
            let expected = x + v * t + 0.5 * acceleration * t * t;
            // 20 roundings of a few times 1e-16 per step, on some 5 m and 5 m/s.
            assert_close(centre(&plant.state, 0), expected, 1e-10);
            assert_close(centre(&plant.state, 1), v + acceleration * t, 1e-10);
        }
    }

    #[test]
    fn stretched_chain_moves_as_one() {
        let drive = mixed();
        let current = 0.3;
        let acceleration = drive.force_constant * current / 0.145;
        let mut plant = ReferencePlant::new(&drive, &stretched(&drive, acceleration));
        let start = plant.state.clone();
        for _ in 0..200 {
            plant.advance(current, drive.sample_time, 20);
        }
        for element in 0..4 {
            let travel = plant.state[2 * element] - start[2 * element];
            assert_close(travel, 0.5 * acceleration * 0.04, 1e-11);
        }
    }

    #[test]
    fn two_masses_vibrate_as_the_damped_oscillator() {
        let drive = two_masses(0.15);
        let (k, c) = (200.0, 0.15);
        let inverse_mass = 1.0 / 0.059 + 1.0 / 0.03;
        let decay: f64 = 0.5 * c * inverse_mass;
        let omega = (k * inverse_mass - decay * decay).sqrt();
        let mut plant = ReferencePlant::new(&drive, &[0.0, 0.0, 0.01, 0.0]);
        for step in 1..=300 {
            plant.advance(0.0, drive.sample_time, 20);
            let t = f64::from(step) * drive.sample_time;
            let expected =
                0.01 * (-decay * t).exp() * ((omega * t).cos() + decay / omega * (omega * t).sin());
            assert_close(plant.state[2] - plant.state[0], expected, 1e-12);
            // The centre of mass stays.
            let centre = (0.059 * plant.state[0] + 0.03 * plant.state[2]) / 0.089;
            assert_close(centre, 0.01 * 0.03 / 0.089, 1e-13);
        }
    }

    #[test]
    fn substeps_do_not_matter_without_friction() {
        let drive = mixed();
        let mut coarse = ReferencePlant::new(&drive, &DISTURBED);
        let mut fine = coarse.clone();
        for current in [0.5, -0.3, 1.0] {
            coarse.advance(current, 0.01, 1);
            fine.advance(current, 0.01, 37);
        }
        assert_all_close(&coarse.state, &fine.state, 1e-12);
    }

    // State observers.

    #[test]
    fn anchored_prediction_is_exact_for_a_steady_motion() {
        // One load, actuator moving at constant speed from the first sample on; no correction.
        let (k, c, m): (f64, f64, f64) = (200.0, 0.8, 0.03);
        let drive = two_masses(c);
        let observer = ReferenceObserver::Anchored;
        let gains = zero_gains(&drive, observer);
        let mut controller = ReferenceController::new(&drive, &gains, observer);
        controller.step(0, 0.0, 0.0);
        let speed = 0.05;
        let decay = 0.5 * c / m;
        let omega = (k / m - decay * decay).sqrt();
        let deflection = |t: f64| -speed / omega * (-decay * t).exp() * (omega * t).sin();
        let rate = |t: f64| {
            -speed * (-decay * t).exp() * ((omega * t).cos() - decay / omega * (omega * t).sin())
        };
        let force = |t: f64| -k * deflection(t) - c * rate(t);
        let (g1, g2) = (drive.disturbance_cutoff, drive.reaction_force_cutoff);
        for step in 1..=60_u32 {
            let t = f64::from(step) * drive.sample_time;
            let output = controller.step(50 * step, 0.0, 0.0);
            assert_close(output.estimate[0], speed * t, 1e-14);
            assert_close(output.estimate[2], speed * t + deflection(t), 1e-12);
            assert_close(output.estimate[3], speed + rate(t), 1e-11);
            let state = &controller.memory.as_ref().unwrap().state;
            let once = integral(t, |s| g1 * (-g1 * (t - s)).exp() * force(s));
            assert_close(state[2], once, 1e-8);
            let twice = integral(t, |s| {
                let kernel = (-g1 * (t - s)).exp() - (-g2 * (t - s)).exp();
                g1 * g2 / (g2 - g1) * kernel * force(s)
            });
            assert_close(state[3], twice, 1e-8);
            assert_eq!(state[4], 0.0);
        }
    }

    #[test]
    fn anchored_load_is_the_chain_behind_an_unyielding_actuator() {
        let mut drive = mixed();
        let observer = ReferenceObserver::Anchored;
        let gains = zero_gains(&drive, observer);
        let mut controller = ReferenceController::new(&drive, &gains, observer);
        drive.actuator_mass = 1e15;
        let mut plant = ReferencePlant::new(&drive, &[0.0, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        controller.step(plant.count(), 0.0, 0.0);
        for _ in 0..200 {
            plant.advance(0.0, drive.sample_time, 20);
            let output = controller.step(plant.count(), 0.0, 0.0);
            assert_all_close(&output.estimate[2..], &plant.state[2..], 1e-10);
        }
    }

    #[test]
    fn anchored_disturbance_reaches_the_force_through_both_lags() {
        let drive = mixed();
        let observer = ReferenceObserver::Anchored;
        let gains = zero_gains(&drive, observer);
        let mut controller = ReferenceController::new(&drive, &gains, observer);
        controller.step(0, 0.0, 0.0);
        controller.memory.as_mut().unwrap().state[8] = 1.0;
        let (g1, g2) = (drive.disturbance_cutoff, drive.reaction_force_cutoff);
        for k in 1..=10 {
            let t = f64::from(k) * drive.sample_time;
            let output = controller.step(0, 0.0, 0.0);
            let state = &controller.memory.as_ref().unwrap().state;
            let (first, second) = ((-g1 * t).exp(), (-g2 * t).exp());
            assert_all_close(&state[..6], &[0.0; 6], 0.0);
            assert_close(state[6], 1.0 - first, 1e-13);
            let twice = 1.0 - (g2 * first - g1 * second) / (g2 - g1);
            assert_close(state[7], twice, 1e-13);
            assert_eq!(output.disturbance_state, 1.0);
            assert_close(output.unlimited_current, 1.0 / drive.force_constant, 1e-15);
        }
    }

    #[test]
    fn anchored_correction_follows_the_prediction() {
        // Blocked actuator, load at rest: the prediction is zero, so that the state is the gain
        // times the whole force.
        let drive = mixed();
        let mut gains = zero_gains(&drive, ReferenceObserver::Anchored);
        gains.observer_gain = (1..=9).map(|j| 1e-4 * f64::from(j)).collect();
        let mut controller = ReferenceController::new(&drive, &gains, ReferenceObserver::Anchored);
        controller.step(0, 0.0, 0.0);
        let output = controller.step(0, 1.0, 0.0);
        assert!(output.reaction_force > 0.5);
        let state = &controller.memory.as_ref().unwrap().state;
        for (element, gain) in state.iter().zip(&gains.observer_gain) {
            assert_close(*element, gain * output.reaction_force, 1e-16);
        }
        assert_eq!(output.estimate[2..], state[..6]);
        assert_eq!(output.disturbance_state, state[8]);
    }

    #[test]
    fn anchored_observer_is_unbiased_under_steady_acceleration() {
        let mut drive = rig();
        drive.encoder_resolution = 1e-9;
        drive.counter_bits = 32;
        let current = 0.1;
        let acceleration = drive.force_constant * current / 0.116;
        let mut plant = ReferencePlant::new(&drive, &stretched(&drive, acceleration));
        let observer = ReferenceObserver::Anchored;
        let mut controller = ReferenceController::new(&drive, &rig_gains(), observer);
        // The observer starts from undeflected springs, a millimetre away from the truth.
        controller.step(plant.count(), 0.0, 0.0);
        let mut output = None;
        for _ in 0..600 {
            plant.advance(current, drive.sample_time, 20);
            output = Some(controller.step(plant.count(), current, 0.0));
        }
        let output = output.unwrap();
        // The held velocity is the ramp of the true one to within a T / 2; through the dampers
        // that amounts to at most c a T of force, and c a T / k of deflection, per element.
        let slack = drive.damping[0] * acceleration * drive.sample_time;
        assert!(slack < 2e-3 * output.reaction_force);
        assert_close(output.disturbance_state, 0.0, slack);
        for load in 1..=3 {
            let truth = plant.state[2 * load] - plant.state[0];
            assert!(truth < -1e-3);
            let estimate = output.estimate[2 * load] - output.estimate[0];
            assert_close(estimate, truth, 3.0 * slack / drive.stiffness[0]);
        }
    }

    #[test]
    fn anchored_observer_finds_and_removes_a_force_on_the_actuator() {
        let drive = ReferenceDrive {
            current_resolution: 0.0,
            ..rig()
        };
        let (force, target) = (0.2, 0.03);
        let observer = ReferenceObserver::Anchored;
        let mut controller = ReferenceController::new(&drive, &rig_gains(), observer);
        let mut plant = ReferencePlant::new(&drive, &[0.0; 8]);
        let mut current = 0.0;
        let mut disturbance_state = 0.0;
        for _ in 0..1500 {
            let output = controller.step(plant.count(), current, target);
            current = output.current;
            disturbance_state = output.disturbance_state;
            // A force against the motion, told to nobody.
            plant.advance(
                current - force / drive.force_constant,
                drive.sample_time,
                20,
            );
        }
        assert_close(disturbance_state, force, 2e-3);
        for element in 0..4 {
            // Without d the chain would stop more than a millimetre short.
            assert_close(plant.state[2 * element], target, 5e-6);
        }
    }

    #[test]
    fn reaction_prediction_is_the_free_chain() {
        // Perfect model, known current: without any correction the estimate is the truth,
        // velocity and position of the actuator included.
        let drive = mixed();
        let observer = ReferenceObserver::Reaction;
        let gains = zero_gains(&drive, observer);
        let mut controller = ReferenceController::new(&drive, &gains, observer);
        let start = [0.005, 0.0, 0.005, 0.0, 0.005, 0.0, 0.005, 0.0];
        let mut plant = ReferencePlant::new(&drive, &start);
        let first = controller.step(plant.count(), 0.0, 0.0);
        assert_all_close(&first.estimate, &start, 1e-13);
        for k in 0..300 {
            let current = (0.05 * f64::from(k)).sin();
            plant.advance(current, drive.sample_time, 20);
            let output = controller.step(plant.count(), current, 0.0);
            assert_all_close(&output.estimate, &plant.state, 1e-10);
            assert_eq!(output.disturbance_state, 0.0);
        }
    }

    #[test]
    fn reaction_correction_follows_the_prediction() {
        let drive = mixed();
        let observer = ReferenceObserver::Reaction;
        let mut gains = zero_gains(&drive, observer);
        let mut bare = ReferenceController::new(&drive, &gains, observer);
        gains.observer_gain = (1..=8).map(|j| 0.01 * f64::from(j)).collect();
        let mut corrected = ReferenceController::new(&drive, &gains, observer);
        for controller in [&mut bare, &mut corrected] {
            controller.step(100, 0.0, 0.0);
        }
        let predicted = bare.step(130, 0.8, 0.0).estimate;
        let output = corrected.step(130, 0.8, 0.0);
        let model_force =
            400.0 * (predicted[0] - predicted[2]) + 0.2 * (predicted[1] - predicted[3]);
        for (j, gain) in gains.observer_gain.iter().enumerate() {
            let expected = predicted[j] + gain * (output.reaction_force - model_force);
            assert_close(output.estimate[j], expected, 1e-14);
        }
    }

    #[test]
    fn reaction_observer_never_corrects_a_rigid_offset() {
        // A force nobody knows pushes the centre of mass away from the estimate for good, by
        // F t^2 / 2 M: 0.86 m after one second of 0.2 N. No gain could tell.
        let drive = rig();
        let observer = ReferenceObserver::Reaction;
        let gains = zero_gains(&drive, observer);
        let mut controller = ReferenceController::new(&drive, &gains, observer);
        let mut plant = ReferencePlant::new(&drive, &[0.0; 8]);
        let mut estimate = controller.step(0, 0.0, 0.0).estimate;
        for _ in 0..1000 {
            plant.advance(-0.2 / drive.force_constant, drive.sample_time, 20);
            estimate = controller.step(plant.count(), 0.0, 0.0).estimate;
        }
        let centre =
            |x: &[f64]| (0.059 * x[0] + 0.019 * (x[2] + x[4] + x[6])) / (0.059 + 3.0 * 0.019);
        assert_close(centre(&estimate) - centre(&plant.state), 0.862, 1e-3);
    }

    // Regulator and limiter.

    #[test]
    fn command_is_gain_times_error_plus_disturbance() {
        let drive = ReferenceDrive {
            current_resolution: 0.0,
            ..rig()
        };
        let mut gains = rig_gains();
        gains.observer_gain = vec![0.0; 9];
        let observer = ReferenceObserver::Anchored;
        let mut controller = ReferenceController::new(&drive, &gains, observer);
        // At rest at 1 mm, target 2 mm.
        let output = controller.step(1000, 0.0, 0.002);
        let expected = 0.001 * (59.3959 - 26.5573 - 6.9015 + 2.2091);
        assert_close(output.current, expected, 1e-14);
        // Each state in turn, on its own.
        for element in 0..6 {
            controller.memory.as_mut().unwrap().state = vec![0.0; 9];
            controller.memory.as_mut().unwrap().state[element] = 1e-3;
            let memory = controller.memory.clone();
            controller.transition = exponential(&zeros(9, 9));
            let output = controller.step(1000, 0.0, 0.001);
            let expected = -1e-3 * REGULATOR[element + 2];
            assert_close(output.unlimited_current, expected, 1e-15);
            assert_eq!(
                memory.unwrap().state,
                controller.memory.as_ref().unwrap().state
            );
        }
    }

    #[test]
    fn measured_velocity_enters_the_command() {
        let drive = rig();
        let mut gains = zero_gains(&drive, ReferenceObserver::Anchored);
        gains.regulator[1] = 2.0;
        let mut controller = ReferenceController::new(&drive, &gains, ReferenceObserver::Anchored);
        controller.step(0, 0.0, 0.0);
        let output = controller.step(20, 0.0, 0.0);
        let velocity = (1.0 - (-0.628_f64).exp()) * 0.02;
        assert_close(output.estimate[1], velocity, 1e-15);
        assert_close(output.unlimited_current, -2.0 * velocity, 1e-15);
    }

    #[test]
    fn commands_are_limited_and_rounded() {
        let coarse = ReferenceDrive {
            current_limit: 2.0,
            current_resolution: 0.25,
            ..rig()
        };
        for (command, expected) in [
            (0.1, 0.0),
            (0.125, 0.25),
            (-0.125, -0.25),
            (0.3, 0.25),
            (1.99, 2.0),
            (2.3, 2.0),
            (-9.0, -2.0),
            (f64::NAN, 0.0),
            (f64::INFINITY, 0.0),
            (f64::NEG_INFINITY, 0.0),
        ] {
            assert_eq!(limited(&coarse, command), expected);
        }
        let continuous = ReferenceDrive {
            current_resolution: 0.0,
            ..coarse
        };
        assert_eq!(limited(&continuous, 0.3), 0.3);
        assert_eq!(limited(&continuous, -2.3), -2.0);
    }

    #[test]
    fn non_finite_inputs_command_nothing() {
        let observer = ReferenceObserver::Anchored;
        let mut controller = ReferenceController::new(&rig(), &rig_gains(), observer);
        let output = controller.step(0, 0.0, f64::NAN);
        assert!(output.unlimited_current.is_nan());
        assert_eq!(output.current, 0.0);
    }

    // Closed loop.

    #[test]
    fn samples_carry_the_current_of_the_period_before() {
        let observer = ReferenceObserver::Anchored;
        let drive = rig();
        let run = closed_loop(&drive, &rig_gains(), observer, 0.03, &[0.0; 8], 50);
        assert_eq!(run.len(), 50);
        assert_eq!(run[0].applied_current, 0.0);
        assert_close(run[0].output.current, 0.844, 1e-12);
        for pair in run.windows(2) {
            assert_eq!(pair[1].applied_current, pair[0].output.current);
        }
        // The first current acts over the first period, from rest.
        let mut plant = ReferencePlant::new(&drive, &[0.0; 8]);
        plant.advance(0.844, 1e-3, 1);
        assert_all_close(&run[1].plant_state, &plant.state, 1e-14);
        assert_eq!(run[1].count, plant.count());
    }

    #[test]
    fn step_of_30_mm_settles_without_residual_vibration() {
        let observer = ReferenceObserver::Anchored;
        let target = 0.03;
        let run = closed_loop(&rig(), &rig_gains(), observer, target, &[0.0; 8], 1200);
        let outside = |s: &ReferenceSample| (s.plant_state[4] - target).abs() > 0.02 * target;
        let settled = run.iter().rposition(outside).unwrap() + 1;
        assert!((139..=145).contains(&settled), "{settled} ms");
        for element in [0, 2, 4, 6] {
            let tail = run[500..].iter().map(|s| s.plant_state[element]);
            let (low, high) = tail.fold((f64::MAX, f64::MIN), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            assert!(high - low < 10e-6, "{} m", high - low);
            assert_close(0.5 * (high + low), target, 5e-6);
            let squares: f64 = run
                .iter()
                .map(|s| (s.output.estimate[element] - s.plant_state[element]).powi(2))
                .sum();
            let rms = (squares / run.len() as f64).sqrt();
            assert!(rms < 50e-6, "{rms} m");
        }
    }

    #[test]
    fn place_on_the_axis_does_not_matter() {
        let drive = ReferenceDrive {
            current_resolution: 0.0,
            ..rig()
        };
        let observer = ReferenceObserver::Anchored;
        let run = |origin: f64| {
            let mut state = [0.0; 8];
            for x in state.iter_mut().step_by(2) {
                *x = origin;
            }
            closed_loop(&drive, &rig_gains(), observer, origin + 0.03, &state, 150)
        };
        for (here, there) in run(0.0).iter().zip(&run(0.02)) {
            assert_close(here.output.current, there.output.current, 1e-9);
            let disturbance = here.output.disturbance;
            assert_close(disturbance, there.output.disturbance, 1e-9);
        }
    }

    #[test]
    fn deflected_chain_returns_to_the_origin() {
        let observer = ReferenceObserver::Anchored;
        let start = [0.01, 0.0, 0.012, 0.0, 0.014, 0.0, 0.015, 0.0];
        let run = closed_loop(&rig(), &rig_gains(), observer, 0.0, &start, 1000);
        assert_eq!(run[0].output.position, 0.01);
        assert_close(run[0].output.estimate[6], 0.01, 1e-15);
        for x in run[999].plant_state.iter().step_by(2) {
            assert_close(*x, 0.0, 5e-6);
        }
    }
}
