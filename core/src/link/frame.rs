//! Frames: a message with a tag and a checksum, between zeros.
//!
//! ```text
//! 0, COBS(tag, message, CRC-32 of both, lowest byte first), 0
//! ```
//!
//! Tag and message are as postcard serialises them; the checksum is CRC-32 (ISO-HDLC); COBS (Cheshire and Baker,
//! IEEE/ACM Transactions on Networking 7, 1999) takes the zeros out, so that a zero ends a frame and nothing
//! else. The one in front ends whatever came before: an unplugged line costs no frame but its own.

use crc::{CRC_32_ISO_HDLC, Crc};
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Checksum of a frame, and of whatever else the drive says in serialised form.
pub static CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// Bytes of a checksum.
const CHECK: usize = 4;
/// Longest frame, its zeros included; a record of six loads takes 120 bytes.
pub const LONGEST: usize = 192;

/// A frame, ready to be sent; none where it is too long.
pub fn frame<'a, T: Serialize>(
    tag: u16,
    message: &T,
    buffer: &'a mut [u8; LONGEST],
) -> Option<&'a [u8]> {
    let mut plain = [0; LONGEST];
    let said = postcard::to_slice(&(tag, message), &mut plain).ok()?.len();
    let end = said.checked_add(CHECK)?;
    let check = CHECKSUM.checksum(plain.get(..said)?).to_le_bytes();
    plain.get_mut(said..end)?.copy_from_slice(&check);
    // Zeros as they are, in front and behind.
    buffer.fill(0);
    let inner = buffer.get_mut(1..LONGEST - 1)?;
    let length = cobs::try_encode(plain.get(..end)?, inner).ok()?;
    buffer.get(..length.checked_add(2)?)
}

/// Puts frames together from bytes as they come.
#[derive(Clone, Debug, Default)]
pub struct Receiver {
    bytes: Vec<u8, LONGEST>,
    /// Whether what comes is too long for a frame.
    overlong: bool,
    /// Whether what is there has been given away.
    ended: bool,
}

/// What is not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Damaged;

/// A frame that has come whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Its tag.
    pub tag: u16,
    message: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Its message.
    ///
    /// # Errors
    /// [`Damaged`] where it is no such message.
    pub fn message<T: Deserialize<'a>>(&self) -> Result<T, Damaged> {
        match postcard::take_from_bytes(self.message) {
            Ok((message, [])) => Ok(message),
            _ => Err(Damaged),
        }
    }
}

impl Receiver {
    /// Takes a byte; says what it ends.
    pub fn take(&mut self, byte: u8) -> Option<Result<Frame<'_>, Damaged>> {
        if self.ended {
            self.bytes.clear();
            (self.ended, self.overlong) = (false, false);
        }
        if byte != 0 {
            self.overlong |= self.bytes.push(byte).is_err();
            return None;
        }
        self.ended = true;
        // Zeros in a row are no frames.
        (!self.bytes.is_empty()).then(|| self.whole().ok_or(Damaged))
    }

    /// What has come, as a frame.
    fn whole(&mut self) -> Option<Frame<'_>> {
        if self.overlong {
            return None;
        }
        let length = cobs::decode_in_place(&mut self.bytes).ok()?;
        let (said, check) = self.bytes.get(..length)?.split_last_chunk::<CHECK>()?;
        if CHECKSUM.checksum(said) != u32::from_le_bytes(*check) {
            return None;
        }
        let (tag, message) = postcard::take_from_bytes(said).ok()?;
        Some(Frame { tag, message })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::message::{Answer, Answered, Ask, Asked, HELLO, TAG, WORDS};
    use super::*;
    use crate::mode::Mode;
    use crate::request::{At, Homing};
    use crate::request::{Reason, Refusal, Request};
    use crate::telemetry::Telemetry;
    use crate::units::{Current, Place, Velocity};
    use proptest::prelude::*;
    use std::vec::Vec as List;

    fn framed<T: Serialize>(message: &T) -> List<u8> {
        let mut buffer = [0; LONGEST];
        frame(TAG, message, &mut buffer).unwrap().to_vec()
    }

    /// What is read of some bytes.
    fn read(receiver: &mut Receiver, bytes: &[u8]) -> List<Result<Asked, Damaged>> {
        let mut read = List::new();
        for byte in bytes {
            if let Some(frame) = receiver.take(*byte) {
                read.push(frame.and_then(|frame| {
                    assert_eq!(frame.tag, TAG);
                    frame.message()
                }));
            }
        }
        read
    }

    fn question(number: u8, place: i64) -> Asked {
        let ask = Ask::Request(Request::Move(Place(place)));
        Asked { number, ask }
    }

    /// The bytes are those that the named standards make: CRC-32 of "123456789" is 0xCBF43926, and COBS puts
    /// the distance to each zero in its place.
    #[test]
    fn a_frame_is_what_the_standards_say() {
        let mut buffer = [0; LONGEST];
        let digits = *b"123456789";
        // Without a tag in front the checksum could be looked up; with it, it is of tag and digits.
        assert_eq!(CHECKSUM.checksum(&digits), 0xCBF4_3926);
        let bytes = frame(HELLO, &digits, &mut buffer).unwrap();
        // The tag is one zero: the first group is empty, the second has digits and checksum.
        assert_eq!(bytes[..3], [0, 1, 14]);
        assert_eq!(bytes[3..12], digits);
        let mut said = List::from([0]);
        said.extend(digits);
        assert_eq!(bytes[12..16], CHECKSUM.checksum(&said).to_le_bytes());
        assert_eq!(bytes[16..], [0]);
    }

    #[test]
    fn the_longest_messages_fit() {
        let telemetry = Telemetry {
            period: u32::MAX,
            count: u32::MAX,
            cycles: u32::MAX,
            ..Telemetry::<[f32; 6]>::default()
        };
        let longest = [
            Answer::Telemetry(telemetry),
            Answer::LastMoves([u32::MAX; WORDS].into_iter().collect()),
        ];
        for answer in longest {
            let number = u8::MAX;
            assert!(framed(&Answered { number, answer }).len() > 100);
        }
    }

    proptest! {
        /// Whatever stands between frames, what is read is what was sent, once, in its order.
        #[test]
        fn noise_between_frames_costs_no_frame(
            places in prop::collection::vec(any::<i64>(), 1..5),
            noise in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..400), 5),
        ) {
            let mut receiver = Receiver::default();
            let mut found = List::new();
            for (place, noise) in places.iter().zip(&noise) {
                let mut bytes = noise.clone();
                bytes.extend(framed(&question(1, *place)));
                found.extend(read(&mut receiver, &bytes).into_iter().flatten());
            }
            let sent: List<Asked> = places.iter().map(|place| question(1, *place)).collect();
            prop_assert_eq!(found, sent);
        }

        /// A frame with one bit turned over, or a part of it missing, is no frame.
        #[test]
        fn a_damaged_frame_is_none(
            place: i64, at in 0_usize..1000, bit in 0_u8..8, cut in 1_usize..1000,
        ) {
            let whole = framed(&question(7, place));
            // What it is but for the zeros.
            let whole = whole[1..].to_vec();
            let last = whole.len() - 1;
            let mut turned = whole.clone();
            turned[at % last] ^= 1 << bit;
            let mut short = whole.clone();
            short.drain(cut % last..last);
            for bytes in [turned, short] {
                let mut receiver = Receiver::default();
                prop_assert!(read(&mut receiver, &bytes).iter().all(Result::is_err));
                // The next one is read again.
                let next = read(&mut receiver, &framed(&question(8, 1)));
                prop_assert_eq!(next.last(), Some(&Ok(question(8, 1))));
            }
        }

        /// Every question comes back.
        #[test]
        fn questions_survive(number: u8, place: i64, velocity: f32, period: u16) {
            let mut receiver = Receiver::default();
            for ask in [
                Ask::Status,
                Ask::Request(Request::MoveBy(place)),
                Ask::Request(Request::Jog(Velocity(velocity))),
                Ask::Request(Request::Home(Homing {
                    velocity: Velocity(velocity),
                    at: At::Stop { current: Current(velocity) },
                    position: Place(place),
                    back_off: u32::from(period),
                })),
                Ask::Subscribe(period),
                Ask::LastMoves(period),
                Ask::Faults,
            ] {
                let asked = Asked { number, ask };
                let found = read(&mut receiver, &framed(&asked));
                if velocity.is_nan() {
                    continue;
                }
                prop_assert_eq!(found, std::vec![Ok(asked)]);
            }
        }
    }

    /// A drive with another number of loads is read by the same program.
    #[test]
    fn answers_survive() {
        let refusal = Refusal {
            request: Request::Halt,
            mode: Mode::Idle,
            reason: Reason::RunSwitch,
        };
        let said = Answered::<[f32; 3]> {
            number: 9,
            answer: Answer::Refused(refusal),
        };
        let mut receiver = Receiver::default();
        let bytes = framed(&said);
        let (last, rest) = bytes.split_last().unwrap();
        assert!(rest.iter().all(|byte| receiver.take(*byte).is_none()));
        let heard: Answered<List<f32>> = receiver.take(*last).unwrap().unwrap().message().unwrap();
        assert_eq!(heard.answer, Answer::Refused(refusal));
    }
}
