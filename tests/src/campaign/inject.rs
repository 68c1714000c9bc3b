//! Breaking one thing in a running rig.

use super::faults::{Fault, Machine, Processor};
use super::stage::Stage;
use crate::virtual_board::Rig;
use crate::virtual_board::bus::Patch;
use crate::virtual_board::harm::InterruptFault;
use host_sim::drive::PlantFile;
use host_sim::machine::ExternalForce;

/// Data register of the converter, DHR12R1.
const CONVERTER_DATA: u32 = 0x4000_7408;
/// A mass that nothing moves, kg.
const IMMOVABLE: f64 = 1e6;

/// Begins a fault; returns the period, counted from now, in which it is over if it ends by itself.
pub fn begin(fault: Fault, rig: &mut Rig, stage: &Stage, seed: u64) -> Option<u32> {
    rig.as_hardware = true;
    match fault {
        Fault::Encoder(fault) => rig.encoder.fail(fault, seed),
        Fault::Jump(counts) => rig.board.bus_mut().encoder.upset(counts),
        Fault::Amplifier(fault) => rig.amplifier.fail(fault),
        Fault::Register { mask, value } => {
            let bus = rig.board.bus_mut();
            let now = bus.read(CONVERTER_DATA).unwrap_or(0);
            let value = value.unwrap_or(now) & mask;
            bus.patch = Some(Patch {
                address: CONVERTER_DATA,
                mask,
                value,
            });
            // The bits are stuck before the next write as well.
            let _ = bus.write(CONVERTER_DATA, now & !mask | value);
        }
        Fault::LeadsReversed => rig.wiring.motor_reversed ^= true,
        Fault::Machine(fault) => return machine(fault, rig, stage.machine()),
        Fault::Push {
            last_load,
            share,
            duration,
        } => {
            let mut plant = stage.machine();
            let actuator = &plant.actuator;
            let newton = share * actuator.largest_force();
            plant.forces.push(ExternalForce {
                mass: if last_load { plant.loads.len() } else { 0 },
                start: 0.0,
                duration,
                newton,
            });
            rig.change_plant(&plant, 1, false);
        }
        Fault::Interrupt(fault) => {
            if fault == InterruptFault::Late {
                rig.change_plant(&stage.machine(), 2, false);
            }
            rig.interrupts.fail(fault, seed);
        }
        Fault::Processor(fault) => processor(fault, rig, stage),
        Fault::Log(host) => rig.log_host = host,
    }
    None
}

/// Ends a fault that ends by itself.
pub fn end(rig: &mut Rig, stage: &Stage) {
    rig.change_plant(&stage.machine(), 1, false);
}

fn machine(fault: Machine, rig: &mut Rig, mut plant: PlantFile) -> Option<u32> {
    let (mut stopped, mut ends) = (false, None);
    match fault {
        Machine::Detached => {
            if let Some(load) = plant.loads.first_mut() {
                (load.stiffness, load.damping) = (0.0, 0.0);
            }
        }
        Machine::LastLoad(factor) => {
            if let Some(load) = plant.loads.last_mut() {
                load.mass *= factor;
            }
        }
        Machine::AllLoads(factor) => {
            for load in &mut plant.loads {
                load.mass *= factor;
            }
        }
        Machine::Stiffness(factor) => {
            for load in &mut plant.loads {
                load.stiffness *= factor;
            }
        }
        Machine::Friction(coulomb) => plant.friction.coulomb += coulomb,
        Machine::Blocked(periods) => {
            plant.actuator.mass = IMMOVABLE;
            (stopped, ends) = (true, periods);
        }
    }
    rig.change_plant(&plant, 1, stopped);
    ends
}

fn processor(fault: Processor, rig: &mut Rig, stage: &Stage) {
    match fault {
        Processor::TimerStopped => {
            let bus = rig.board.bus_mut();
            bus.tick.stop(bus.now);
        }
        Processor::IdleStuck => rig.board.jump(stage.trap),
        Processor::InterruptStuck => rig.board.jump_in_control_interrupt(stage.trap),
        Processor::HardFault => rig.board.hard_fault(),
        Processor::StackLost => {
            rig.board.set_stack_pointer(0x1FFF_0000);
            rig.board.hard_fault();
        }
        Processor::Crystal => {
            if !rig.board.bus_mut().fail_crystal() {
                // Without a clock nothing happens any more.
                rig.board.jump_in_control_interrupt(stage.trap);
            }
        }
        Processor::Supply => rig.board.bus_mut().power.set_supply(2.5),
        Processor::Reset => rig.reset_board(&stage.fresh),
    }
}
