//! The words of a SPIR-V module, cut into instructions.

/// Words before the first instruction: magic number, version, generator, bound of ids, schema.
pub const HEADER: usize = 5;
/// Place among them of the number that all ids are below.
pub const BOUND: usize = 3;

/// An instruction: its opcode and its operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction<'a> {
    /// One of those that [`super::op`] names, or another.
    pub opcode: u16,
    /// The operands, the type and the id of a result first.
    pub words: &'a [u32],
}

impl Instruction<'_> {
    /// Appends its words to a module.
    pub fn write(&self, module: &mut Vec<u32>) {
        module.push((self.words.len() as u32 + 1) << 16 | u32::from(self.opcode));
        module.extend(self.words);
    }
}

/// All of a module; `None` for what is no module.
pub fn instructions(words: &[u32]) -> Option<Vec<Instruction<'_>>> {
    const MAGIC: u32 = 0x0723_0203;
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
