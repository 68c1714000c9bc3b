//! Switches of the board, as levels.

use arso_firmware::board::{self, Inputs, Levels};
use embedded_hal::digital::InputPin;
use stm32f4xx_hal::gpio::{Input, gpiob, gpioc};

/// The run switch: high is closed, the pull-down opens a broken line.
pub(crate) struct RunSwitch<Pin = gpioc::PC2<Input>>(pub(super) Pin);

impl<Pin: InputPin> board::RunSwitch for RunSwitch<Pin> {
    fn closed(&mut self) -> bool {
        self.0.is_high().unwrap_or(false)
    }
}

/// The amplifier's fault line: low is a fault; the pull-up stands for an amplifier that has none.
pub(crate) struct AmplifierFault<Pin = gpiob::PB13<Input>>(pub(super) Pin);

impl<Pin: InputPin> board::AmplifierFault for AmplifierFault<Pin> {
    fn active(&mut self) -> bool {
        self.0.is_low().unwrap_or(true)
    }
}

/// The home switch: high is active; with a broken line homing finds nothing.
pub(crate) struct HomeSwitch<Pin = gpioc::PC5<Input>>(pub(super) Pin);

impl<Pin: InputPin> board::HomeSwitch for HomeSwitch<Pin> {
    fn active(&mut self) -> bool {
        self.0.is_high().unwrap_or(false)
    }
}

/// Excite switch, zero switch and both bits of the target switches.
pub(crate) struct Switches<
    Excite = gpioc::PC3<Input>,
    Zero = gpioc::PC4<Input>,
    Low = gpioc::PC0<Input>,
    High = gpioc::PC1<Input>,
> {
    excite: Excite,
    zero: Zero,
    low: Low,
    high: High,
}

impl<Excite: InputPin, Zero: InputPin, Low: InputPin, High: InputPin>
    Switches<Excite, Zero, Low, High>
{
    pub(super) fn new(excite: Excite, zero: Zero, low: Low, high: High) -> Self {
        Self {
            excite,
            zero,
            low,
            high,
        }
    }
}

impl<Excite: InputPin, Zero: InputPin, Low: InputPin, High: InputPin> Inputs
    for Switches<Excite, Zero, Low, High>
{
    fn read(&mut self) -> Levels {
        let low = self.low.is_high().unwrap_or(false);
        let high = self.high.is_high().unwrap_or(false);
        Levels {
            excite: self.excite.is_high().unwrap_or(false),
            zero: self.zero.is_high().unwrap_or(false),
            target: u8::from(low) | u8::from(high) << 1,
        }
    }
}
