//! The firmware's ELF: what goes where in memory, and where its symbols are.

use arso_core::link::image::{HEADER, Header};
use object::{Object, ObjectSymbol};

/// Start of flash.
pub const FLASH: u32 = 0x0800_0000;
/// Size of flash, STM32F405RG.
pub const FLASH_SIZE: u32 = 1024 * 1024;
/// Where the flash begins in which the firmware keeps settings, from the start of flash.
pub const SETTINGS: usize = 768 * 1024;
/// Start of SRAM.
pub const RAM: u32 = 0x2000_0000;
/// Size of SRAM.
pub const RAM_SIZE: u32 = 128 * 1024;

/// A firmware image, as a programmer would flash it.
#[derive(Clone, Debug)]
pub struct Image {
    /// Content of flash.
    pub flash: Vec<u8>,
    symbols: Vec<(String, u32)>,
}

impl Image {
    /// Reads an ELF.
    ///
    /// # Errors
    /// One sentence when this is no ELF for this processor or does not fit its flash.
    pub fn parse(elf: &[u8]) -> Result<Self, String> {
        let file = object::File::parse(elf).map_err(|error| format!("not an ELF: {error}"))?;
        if file.architecture() != object::Architecture::Arm || file.is_64() {
            return Err("not an ELF for a 32-bit Arm processor".into());
        }
        let mut flash = vec![0xFF; FLASH_SIZE as usize];
        let object::File::Elf32(elf32) = &file else {
            return Err("not a 32-bit ELF".into());
        };
        let endian = elf32.endian();
        for segment in elf32.elf_program_headers() {
            use object::read::elf::ProgramHeader;
            let data = segment
                .data(endian, elf)
                .map_err(|()| "a segment lies outside the file")?;
            if segment.p_type(endian) != object::elf::PT_LOAD || data.is_empty() {
                continue;
            }
            // Where it is stored, not where it is run: what start-up copies lies in flash.
            let offset = segment.p_paddr(endian).wrapping_sub(FLASH) as usize;
            let place = offset
                .checked_add(data.len())
                .and_then(|end| flash.get_mut(offset..end));
            place
                .ok_or("a segment lies outside of flash")?
                .copy_from_slice(data);
        }
        let symbols = file.symbols().filter_map(|symbol| {
            Some((
                symbol.name().ok()?.to_owned(),
                u32::try_from(symbol.address()).ok()?,
            ))
        });
        let symbols = symbols.collect();
        Ok(Self { flash, symbols })
    }

    /// The image of a drive that keeps a set of settings, its first one.
    ///
    /// # Panics
    /// Where that is none, or too long.
    pub fn keep_settings(&mut self, set: &[u8]) {
        let header = Header {
            serial: 1,
            ..Header::of(set).expect("a set")
        };
        let slot = &mut self.flash[SETTINGS..][..set.len()];
        slot.copy_from_slice(set);
        slot[..HEADER].copy_from_slice(&header.bytes());
    }

    /// Words at the beginning of flash, without symbols.
    #[cfg(test)]
    pub(super) fn of_words(words: &[u32]) -> Self {
        let mut flash: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        flash.resize(FLASH_SIZE as usize, 0xFF);
        Self {
            flash,
            symbols: Vec::new(),
        }
    }

    /// Writes words to addresses, one after the other, and then waits for ever, as every exception does, too;
    /// assembled by hand:
    ///
    /// ```text
    ///        ldr r0, =table
    /// next:  ldmia r0!, {r1, r2}
    ///        cbz r1, wait
    ///        str r2, [r1]
    ///        b next
    /// wait:  b .
    /// ```
    #[cfg(test)]
    pub(super) fn of_writes(writes: &[[u32; 2]]) -> Self {
        let mut words = vec![0x0800_010B; 0x40];
        words[0] = RAM + 0x2000;
        words[1] = 0x0800_0101;
        words.extend([0xC806_4802, 0x600A_B109, 0xE7FE_E7FB, 0x0800_0110]);
        words.extend(writes.as_flattened());
        words.extend([0, 0]);
        Self::of_words(&words)
    }

    /// Address of a symbol.
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols
            .iter()
            .find(|(known, _)| known == name)
            .map(|(_, address)| *address)
    }

    /// Address of the symbol that has this in its name: a compiler puts more around those of statics.
    #[must_use]
    pub fn symbol_with(&self, part: &str) -> Option<u32> {
        self.symbols
            .iter()
            .find(|(known, _)| known.contains(part))
            .map(|(_, address)| *address)
    }

    /// A word of flash.
    #[must_use]
    pub fn word(&self, address: u32) -> u32 {
        let offset = address.wrapping_sub(FLASH) as usize;
        let bytes = self.flash.get(offset..offset + 4);
        bytes.map_or(0, |bytes| {
            u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
        })
    }
}
