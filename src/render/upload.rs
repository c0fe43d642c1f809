//! Uploads of arrays that change from frame to frame.
use crate::error::Result;
use crate::gpu::{Buffer, Recorder};
use bytemuck::Pod;
use std::ops::Range;

/// Uploads an array whole, as [`parts`] does.
///
/// # Errors
/// [`Error::Device`](crate::error::Error::Device).
pub fn whole<T: Pod>(rec: &mut Recorder, to: &mut Buffer<T>, values: &[T]) -> Result<()> {
    parts(rec, to, values, std::slice::from_ref(&(0..values.len())), values.len() / 4)
}

/// Uploads the parts of an array that changed, or all of it where it has outgrown its buffer: to a new one with room for `spare`
/// more. Frames in flight keep the old one.
///
/// # Errors
/// [`Error::Device`](crate::error::Error::Device).
pub fn parts<T: Pod>(
    rec: &mut Recorder,
    to: &mut Buffer<T>,
    values: &[T],
    changed: &[Range<usize>],
    spare: usize,
) -> Result<()> {
    if changed.is_empty() {
        return Ok(());
    }
    if values.len() > to.len() {
        let larger = to.larger(values.len() + spare)?;
        rec.upload(&larger, &[(0, values)])?;
        *to = larger; // only now that its contents are on their way
        return Ok(());
    }
    let parts = joined(changed, values.len());
    rec.upload(to, &parts.into_iter().map(|range| (range.start, &values[range])).collect::<Vec<_>>())
}

/// Sorted ranges that do not overlap, within an array of so many elements.
fn joined(ranges: &[Range<usize>], len: usize) -> Vec<Range<usize>> {
    let mut sorted: Vec<_> = ranges.iter().map(|r| r.start.min(len)..r.end.min(len)).collect();
    sorted.retain(|range| range.start < range.end); // a public field may hold one that ends before it starts
    sorted.sort_unstable_by_key(|range| range.start);
    let mut joined: Vec<Range<usize>> = Vec::new();
    for range in sorted {
        match joined.last_mut().filter(|last| range.start <= last.end) {
            Some(last) => last.end = last.end.max(range.end),
            None => joined.push(range),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::joined;

    #[test]
    fn parts_do_not_overlap() {
        assert_eq!(joined(&[5..9, 0..2, 2..3, 6..12, 20..30, std::ops::Range { start: 5, end: 2 }], 10), [0..3, 5..10]);
    }
}
