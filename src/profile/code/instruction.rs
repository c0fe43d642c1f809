//! The words of a SPIR-V module, cut into instructions.

/// An instruction: its opcode and its operands.
pub struct Instruction<'a> {
    pub opcode: u16,
    pub words: &'a [u32],
}

/// All of a module; `None` for what is no module.
pub fn instructions(words: &[u32]) -> Option<Vec<Instruction<'_>>> {
    const MAGIC: u32 = 0x0723_0203;
    const HEADER: usize = 5;
    let mut rest = words.get(HEADER..).filter(|_| words[0] == MAGIC)?;
    let mut all = Vec::new();
    while let Some(first) = rest.first() {
        let length = (first >> 16) as usize;
        let words = rest.get(1..length)?;
        all.push(Instruction { opcode: *first as u16, words });
        rest = &rest[length..];
    }
    Some(all)
}
