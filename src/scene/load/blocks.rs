//! Text in blocks of whole statements, so that several can be parsed at the same time. Lines end as the system that wrote them has it:
//! by line feeds, carriage returns or both. A line that ends in a backslash is one statement with the next.
use crate::error::Checked;
use std::borrow::Cow;
use std::io::Read;

/// Reads a text block by block.
pub struct Blocks<R> {
    inner: R,
    /// What was read, but lies behind the last whole statement.
    rest: Vec<u8>,
    begun: bool,
    ended: bool,
    /// Why nothing more can be read.
    broken: Option<String>,
}

/// Bytes that are read at a time.
const SIZE: usize = 1 << 19;
/// Most bytes of a statement.
const LONGEST: usize = 1 << 26;
const TOO_LONG: &str = "64 MiB without a line feed: is this an OBJ file?";
const WIDE: &str = "the file is UTF-16 text: save it as UTF-8";

impl<R: Read> Blocks<R> {
    /// Starts before the first line.
    pub fn new(inner: R) -> Self {
        Self { inner, rest: Vec::new(), begun: false, ended: false, broken: None }
    }

    /// The next blocks, so many at most; none at the end of the text, or where [`Self::broken`] says why it cannot be read on.
    pub fn take(&mut self, most: usize) -> Vec<Vec<u8>> {
        let mut blocks = Vec::new();
        while blocks.len() < most && self.broken.is_none() {
            match self.next() {
                Ok(Some(block)) => blocks.push(block),
                Ok(None) => break,
                Err(what) => self.broken = Some(what),
            }
        }
        blocks
    }

    /// Why nothing more can be read: a statement of more than 64 MiB, UTF-16, or what the system says.
    pub fn broken(&self) -> Option<&str> {
        self.broken.as_deref()
    }

    fn next(&mut self) -> Checked<Option<Vec<u8>>> {
        let mut block = std::mem::take(&mut self.rest);
        while !self.ended {
            let before = block.len();
            let read = self.inner.by_ref().take(SIZE as u64).read_to_end(&mut block).map_err(unread)?;
            self.ended = read < SIZE;
            self.begin(&mut block)?;
            if let Some(end) = end_of_statements(&block, before).filter(|_| !self.ended) {
                self.rest = block.split_off(end);
                break;
            }
            if block.len() > LONGEST + 2 {
                return Err(TOO_LONG.to_owned());
            }
        }
        Ok((!block.is_empty()).then_some(block))
    }

    fn begin(&mut self, block: &mut Vec<u8>) -> Checked {
        if std::mem::replace(&mut self.begun, true) {
            return Ok(());
        }
        if block.starts_with(&[0xff, 0xfe]) || block.starts_with(&[0xfe, 0xff]) {
            return Err(WIDE.to_owned());
        }
        if block.starts_with("\u{feff}".as_bytes()) {
            block.drain(..3);
        }
        Ok(())
    }
}

fn unread(error: std::io::Error) -> String {
    format!("the file could not be read to its end: {error}: copy or export it again")
}

/// Where the last whole statement ends, if that is behind the first `known` bytes. The line feed that belongs to a carriage return at the
/// very end may not have been read yet.
fn end_of_statements(block: &[u8], known: usize) -> Option<usize> {
    let ends = |&i: &usize| {
        let line = match (block[i], block.get(i + 1)) {
            (b'\n', _) => block[..i].strip_suffix(b"\r").unwrap_or(&block[..i]),
            (b'\r', Some(next)) if *next != b'\n' => &block[..i],
            _ => return false,
        };
        !line.ends_with(b"\\")
    };
    (known.saturating_sub(1)..block.len()).rev().find(ends).map(|i| i + 1)
}

/// The statements of a block, each with the number of its last line, from 1.
pub struct Statements<'a> {
    rest: &'a str,
    /// Number of lines so far.
    pub lines: u32,
}

impl<'a> Statements<'a> {
    /// Starts before the first one.
    pub fn of(block: &'a str) -> Self {
        Self { rest: block, lines: 0 }
    }

    /// The next line without its end.
    fn line(&mut self) -> &'a str {
        let end = self.rest.bytes().position(|b| b == b'\n' || b == b'\r').unwrap_or(self.rest.len());
        let (line, behind) = self.rest.split_at(end);
        let gap = if behind.starts_with("\r\n") { 2 } else { behind.len().min(1) };
        self.rest = &behind[gap..];
        self.lines += 1;
        line
    }
}

impl<'a> Iterator for Statements<'a> {
    type Item = (u32, Cow<'a, str>);

    fn next(&mut self) -> Option<Self::Item> {
        let mut joined = String::new();
        while !self.rest.is_empty() {
            let line = self.line();
            let is_comment = joined.is_empty() && line.trim_start().starts_with('#'); // which may end in a path
            match line.strip_suffix('\\').filter(|_| !is_comment) {
                Some(part) => joined.extend([part, " "]),
                None if joined.is_empty() => return Some((self.lines, line.into())),
                None => return Some((self.lines, (joined + line).into())),
            }
        }
        (!joined.is_empty()).then(|| (self.lines, joined.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statements(text: &[u8]) -> Vec<(u32, String)> {
        let mut blocks = Blocks::new(text);
        let mut lines = 0;
        let mut all = Vec::new();
        for block in blocks.take(usize::MAX) {
            let block = String::from_utf8(block).unwrap();
            let mut statements = Statements::of(&block);
            all.extend(statements.by_ref().map(|(line, text)| (lines + line, text.into_owned())));
            lines += statements.lines;
        }
        all
    }

    #[test]
    fn what_the_system_says_of_a_file_is_told() {
        struct Failing;
        impl Read for Failing {
            fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
                Err(std::io::Error::other("the disk is gone"))
            }
        }
        let mut blocks = Blocks::new((&b"v 1 2 3\n"[..]).chain(Failing));
        assert!(blocks.take(2).is_empty());
        let said = blocks.broken().unwrap();
        assert!(said.contains("the disk is gone") && !said.contains("mend"), "{said}");
    }

    #[test]
    fn blocks_end_between_statements() {
        let ends =
            [("\n", 3), ("\r\n", 3), ("\r", 3), ("\n\n", 5), ("\r\r\n", 5), ("\\\n", 1), ("\\\r\n", 1), ("\\\r", 1)];
        // Lengths around that of a block, so that it ends at every byte of an end.
        for (shift, (end, count)) in (0..6).flat_map(|shift| ends.map(|end| (shift, end))) {
            let text = format!("{}{end}b{end}c", "a".repeat(SIZE - shift));
            let whole: Vec<_> = Statements::of(&text).map(|(line, text)| (line, text.into_owned())).collect();
            assert_eq!(statements(text.as_bytes()), whole, "{end:?} {shift} bytes before the end");
            assert_eq!(whole.len(), count, "{end:?}");
        }
    }
}
