//! Switches of the board, as levels.

use arso_firmware::board::{Inputs, Levels};
use embedded_hal::digital::InputPin;
use stm32f4xx_hal::gpio::{Input, gpioc};

/// Run switch, excite switch and both bits of the target switches.
pub(crate) struct Switches<
    Run = gpioc::PC2<Input>,
    Excite = gpioc::PC3<Input>,
    Low = gpioc::PC0<Input>,
    High = gpioc::PC1<Input>,
> {
    run: Run,
    excite: Excite,
    low: Low,
    high: High,
}

impl<Run: InputPin, Excite: InputPin, Low: InputPin, High: InputPin>
    Switches<Run, Excite, Low, High>
{
    pub(super) fn new(run: Run, excite: Excite, low: Low, high: High) -> Self {
        Self {
            run,
            excite,
            low,
            high,
        }
    }
}

impl<Run: InputPin, Excite: InputPin, Low: InputPin, High: InputPin> Inputs
    for Switches<Run, Excite, Low, High>
{
    fn read(&mut self) -> Levels {
        let low = self.low.is_high().unwrap_or(false);
        let high = self.high.is_high().unwrap_or(false);
        Levels {
            run: self.run.is_high().unwrap_or(false),
            excite: self.excite.is_high().unwrap_or(false),
            target: u8::from(low) | u8::from(high) << 1,
        }
    }
}
