//! The list of faults, as a user would name them.

use crate::virtual_board::harm::{AmplifierFault, EncoderFault, InterruptFault, LogHost};

/// What breaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// Encoder or cable.
    Encoder(EncoderFault),
    /// The encoder's counter is elsewhere at once.
    Jump(i32),
    /// Amplifier or the wire to it.
    Amplifier(AmplifierFault),
    /// The converter's register keeps bits: which ones, and what they are; nothing for what they are now.
    Register {
        /// Which.
        mask: u32,
        /// What they are.
        value: Option<u32>,
    },
    /// The motor's leads are swapped.
    LeadsReversed,
    /// The machine.
    Machine(Machine),
    /// Something pushes.
    Push {
        /// On which mass, 0 for the actuator, or the last.
        last_load: bool,
        /// How strongly, of the motor's largest force.
        share: f64,
        /// For how long, s.
        duration: f64,
    },
    /// The line of the control interrupt.
    Interrupt(InterruptFault),
    /// The processor.
    Processor(Processor),
    /// The host of the log.
    Log(LogHost),
}

/// What happens to the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Machine {
    /// Spring and damper of the first load are gone.
    Detached,
    /// The last load's mass times this.
    LastLoad(f64),
    /// All loads' masses times this.
    AllLoads(f64),
    /// All stiffnesses times this.
    Stiffness(f64),
    /// Friction of this much on the actuator, N.
    Friction(f64),
    /// The actuator is held, for so many periods or for ever.
    Blocked(Option<u32>),
}

/// What happens to the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Processor {
    /// The control timer's counter stands still.
    TimerStopped,
    /// The idle loop is caught in a loop; interrupts are served.
    IdleStuck,
    /// The control interrupt is caught in a loop.
    InterruptStuck,
    /// It takes a fault.
    HardFault,
    /// The stack pointer is outside of memory, and it takes a fault.
    StackLost,
    /// The reset line is pulled.
    Reset,
    /// The crystal stops.
    Crystal,
    /// The supply falls to 2.5 V.
    Supply,
}

/// A fault with its name.
#[derive(Clone, Copy, Debug)]
pub struct Named {
    /// As a user would say it.
    pub name: &'static str,
    /// What breaks.
    pub fault: Fault,
}

impl Named {
    /// At which of the instants it is tried: each of this many. A host that blocks the log keeps the
    /// processor busy, which is slow to emulate, and does not care for the motion.
    #[must_use]
    pub const fn every(&self) -> usize {
        match self.fault {
            Fault::Log(LogHost::Blocks(_)) => 6,
            _ => 1,
        }
    }
}

const FOR_EVER: f64 = 1e6;

macro_rules! list {
    ($($name:literal => $fault:expr,)*) => {
        /// All faults, by what they break.
        pub const FAULTS: &[Named] = &[$(Named { name: $name, fault: $fault }),*];
    };
}

list! {
    "encoder stuck" => Fault::Encoder(EncoderFault::Stuck),
    "encoder phase A stuck high" => Fault::Encoder(EncoderFault::PhaseA(true)),
    "encoder phase A stuck low" => Fault::Encoder(EncoderFault::PhaseA(false)),
    "encoder phase B stuck high" => Fault::Encoder(EncoderFault::PhaseB(true)),
    "encoder phase B stuck low" => Fault::Encoder(EncoderFault::PhaseB(false)),
    "encoder unplugged" => Fault::Encoder(EncoderFault::Unplugged),
    "encoder phases swapped" => Fault::Encoder(EncoderFault::Swapped),
    "encoder loses 1 % of its counts" => Fault::Encoder(EncoderFault::Lost(0.01)),
    "encoder loses 10 % of its counts" => Fault::Encoder(EncoderFault::Lost(0.1)),
    "encoder loses 50 % of its counts" => Fault::Encoder(EncoderFault::Lost(0.5)),
    "encoder counts doubled" => Fault::Encoder(EncoderFault::Doubled),
    "encoder jumps by 100 counts" => Fault::Jump(100),
    "encoder jumps by -100 counts" => Fault::Jump(-100),
    "encoder jumps by 1000 counts" => Fault::Jump(1000),
    "encoder jumps by -1000 counts" => Fault::Jump(-1000),
    "encoder jumps by 4000 counts" => Fault::Jump(4000),
    "encoder jumps by -4000 counts" => Fault::Jump(-4000),
    "encoder jumps by 16000 counts" => Fault::Jump(16_000),
    "encoder jumps by -16000 counts" => Fault::Jump(-16_000),
    "encoder jumps by 30000 counts" => Fault::Jump(30_000),
    "encoder jumps by -30000 counts" => Fault::Jump(-30_000),
    "encoder noise of 2 counts" => Fault::Encoder(EncoderFault::Noise(2)),
    "encoder noise of 20 counts" => Fault::Encoder(EncoderFault::Noise(20)),
    "amplifier's sign flipped" => Fault::Amplifier(AmplifierFault::Gain(-1.0)),
    "amplifier dead" => Fault::Amplifier(AmplifierFault::Gain(0.0)),
    "amplifier at half gain" => Fault::Amplifier(AmplifierFault::Gain(0.5)),
    "amplifier at double gain" => Fault::Amplifier(AmplifierFault::Gain(2.0)),
    "amplifier stuck at its last current" => Fault::Amplifier(AmplifierFault::StuckAtLast),
    "amplifier stuck at full current" => Fault::Amplifier(AmplifierFault::Stuck(2.0)),
    "amplifier stuck at full negative current" => Fault::Amplifier(AmplifierFault::Stuck(-2.0)),
    "amplifier's current 0.05 A too high" => Fault::Amplifier(AmplifierFault::Offset(0.05)),
    "amplifier's current 0.2 A too high" => Fault::Amplifier(AmplifierFault::Offset(0.2)),
    "amplifier's current 1 A too high" => Fault::Amplifier(AmplifierFault::Offset(1.0)),
    "amplifier 1 ms late" => Fault::Amplifier(AmplifierFault::Late(1)),
    "amplifier 5 ms late" => Fault::Amplifier(AmplifierFault::Late(5)),
    "amplifier 20 ms late" => Fault::Amplifier(AmplifierFault::Late(20)),
    "amplifier ignores its enable line" => Fault::Amplifier(AmplifierFault::EnableIgnored),
    "converter's register stuck" => Fault::Register { mask: 0xFFF, value: None },
    "converter's register bit 11 stuck low" => Fault::Register { mask: 1 << 11, value: Some(0) },
    "converter's output bit 11 stuck high" => Fault::Amplifier(AmplifierFault::Bit { bit: 11, high: true }),
    "converter's output bit 11 stuck low" => Fault::Amplifier(AmplifierFault::Bit { bit: 11, high: false }),
    "converter's output bit 9 stuck high" => Fault::Amplifier(AmplifierFault::Bit { bit: 9, high: true }),
    "converter's output bit 9 stuck low" => Fault::Amplifier(AmplifierFault::Bit { bit: 9, high: false }),
    "motor's leads reversed" => Fault::LeadsReversed,
    "actuator blocked" => Fault::Machine(Machine::Blocked(None)),
    "actuator blocked for 100 ms" => Fault::Machine(Machine::Blocked(Some(100))),
    "first spring breaks" => Fault::Machine(Machine::Detached),
    "last load doubled" => Fault::Machine(Machine::LastLoad(2.0)),
    "all loads halved" => Fault::Machine(Machine::AllLoads(0.5)),
    "springs at half their stiffness" => Fault::Machine(Machine::Stiffness(0.5)),
    "friction of 0.3 N appears" => Fault::Machine(Machine::Friction(0.3)),
    "friction of 3 N appears" => Fault::Machine(Machine::Friction(3.0)),
    "actuator pushed, half the motor's force, 50 ms" => Fault::Push { last_load: false, share: 0.5, duration: 0.05 },
    "actuator pushed, half the motor's force, for ever" => Fault::Push { last_load: false, share: 0.5, duration: FOR_EVER },
    "actuator pushed, 1.5 times the motor's force, 50 ms" => Fault::Push { last_load: false, share: 1.5, duration: 0.05 },
    "actuator pushed, 1.5 times the motor's force, for ever" => Fault::Push { last_load: false, share: 1.5, duration: FOR_EVER },
    "last load pushed, half the motor's force, 50 ms" => Fault::Push { last_load: true, share: 0.5, duration: 0.05 },
    "last load pushed, half the motor's force, for ever" => Fault::Push { last_load: true, share: 0.5, duration: FOR_EVER },
    "last load pushed, 1.5 times the motor's force, 50 ms" => Fault::Push { last_load: true, share: 1.5, duration: 0.05 },
    "last load pushed, 1.5 times the motor's force, for ever" => Fault::Push { last_load: true, share: 1.5, duration: FOR_EVER },
    "every other control interrupt lost" => Fault::Interrupt(InterruptFault::Lost { one_of: 2 }),
    "every tenth control interrupt lost" => Fault::Interrupt(InterruptFault::Lost { one_of: 10 }),
    "control interrupt half a period late at random" => Fault::Interrupt(InterruptFault::Late),
    "control timer stopped" => Fault::Processor(Processor::TimerStopped),
    "idle loop stuck" => Fault::Processor(Processor::IdleStuck),
    "control interrupt stuck" => Fault::Processor(Processor::InterruptStuck),
    "hard fault" => Fault::Processor(Processor::HardFault),
    "stack pointer lost, then hard fault" => Fault::Processor(Processor::StackLost),
    "reset line pulled" => Fault::Processor(Processor::Reset),
    "crystal stops" => Fault::Processor(Processor::Crystal),
    "supply falls to 2.5 V" => Fault::Processor(Processor::Supply),
    "log host absent" => Fault::Log(LogHost::Absent),
    "log host blocks, reads 10 bytes/ms" => Fault::Log(LogHost::Blocks(10.0)),
    "log host blocks, reads 2 bytes/ms" => Fault::Log(LogHost::Blocks(2.0)),
    "log host blocks, reads 0.7 bytes/ms" => Fault::Log(LogHost::Blocks(0.7)),
    "log host blocks, reads nothing" => Fault::Log(LogHost::Blocks(0.0)),
}
