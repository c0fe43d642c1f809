//! One pipeline cache per device, kept on disk between runs: `tallow/<device, driver, kernels>.bin` in
//! `$XDG_CACHE_HOME` or `~/.cache`. A cache is a convenience: whatever goes wrong with the file, it is left aside.
use super::At;
use super::info::Candidate;
use crate::error::Result;
use ash::vk;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The file starts with these, then FNV-1a of the rest, then what the driver returned.
const MAGIC: &[u8; 8] = b"TALLOWP1";

pub(super) struct PipelineCache {
    pub raw: vk::PipelineCache,
    file: Option<PathBuf>,
    /// What was read at the start, so that an unchanged cache is not written again.
    loaded: u64,
}

impl PipelineCache {
    /// # Errors
    /// The device is out of memory.
    pub fn new(device: &ash::Device, candidate: &Candidate) -> Result<Self> {
        let file = folder().map(|folder| folder.join(file_name(candidate)));
        let data = file.as_deref().and_then(read).filter(|data| fits(data, candidate)).unwrap_or_default();
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
        // SAFETY: the data came from this driver (file name, checksum, header); drivers check it once more.
        let raw = unsafe { device.create_pipeline_cache(&info, None) }.at("pipeline cache")?;
        Ok(Self { raw, file, loaded: checksum(&data) })
    }

    /// # Safety
    /// `device` made this cache, nothing uses it, and it is not used again.
    pub unsafe fn store_and_destroy(&self, device: &ash::Device) {
        // SAFETY: by contract.
        let data = unsafe { device.get_pipeline_cache_data(self.raw) };
        if let (Ok(data), Some(file)) = (data, &self.file)
            && checksum(&data) != self.loaded
        {
            // No error is worth failing for: the next run compiles again.
            let _ = write(file, &data);
        }
        unsafe { device.destroy_pipeline_cache(self.raw, None) };
    }
}

fn folder() -> Option<PathBuf> {
    let path = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    Some(path("XDG_CACHE_HOME").or_else(|| Some(path("HOME")?.join(".cache")))?.join("tallow"))
}

fn file_name(candidate: &Candidate) -> String {
    let uuid: String = candidate.cache_uuid.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("{uuid}-{}-{:016x}.bin", candidate.info.driver_version, crate::shaders::HASH)
}

/// The driver's data, if the file is whole.
fn read(file: &Path) -> Option<Vec<u8>> {
    let bytes = std::fs::read(file).ok()?;
    let (sum, data) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<8>()?;
    (checksum(data) == u64::from_le_bytes(*sum)).then(|| data.to_vec())
}

/// Written beside its target and renamed, so that a reader sees all of it or none.
fn write(file: &Path, data: &[u8]) -> std::io::Result<()> {
    let folder = file.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let mut temporary = tempfile::NamedTempFile::new_in(folder)?;
    temporary.write_all(MAGIC)?;
    temporary.write_all(&checksum(data).to_le_bytes())?;
    temporary.write_all(data)?;
    temporary.persist(file)?;
    Ok(())
}

/// Whether the header (`VkPipelineCacheHeaderVersionOne`) names this very device.
fn fits(data: &[u8], candidate: &Candidate) -> bool {
    let word = |at: usize| data.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    word(4) == Some(vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32)
        && word(8) == Some(candidate.vendor)
        && word(12) == Some(candidate.id)
        && data.get(16..32) == Some(&candidate.cache_uuid)
}

/// FNV-1a, 64 bits.
fn checksum(data: &[u8]) -> u64 {
    data.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_returns_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("deeper/cache.bin");
        write(&file, b"driver data").unwrap();
        assert_eq!(read(&file).as_deref(), Some(&b"driver data"[..]));
        let whole = std::fs::read(&file).unwrap();
        for damaged in [&whole[..whole.len() - 1], &whole[..12], &[], b"something else entirely"] {
            std::fs::write(&file, damaged).unwrap();
            assert_eq!(read(&file), None);
        }
        let mut flipped = whole.clone();
        *flipped.last_mut().unwrap() ^= 1;
        std::fs::write(&file, flipped).unwrap();
        assert_eq!(read(&file), None);
    }

    /// VkPipelineCacheHeaderVersionOne: its length, 1, the vendor, the device, 16 bytes of the driver's.
    fn header(c: &Candidate) -> Vec<u8> {
        let words = [32, vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32, c.vendor, c.id];
        words.iter().flat_map(|w| w.to_le_bytes()).chain(c.cache_uuid).chain(*b"data").collect()
    }

    #[test]
    fn caches_are_kept_apart_by_device_driver_and_kernels() {
        let instance = super::super::instance::Instance::new(false).unwrap();
        let mut candidates = super::super::info::candidates(&instance.raw).unwrap();
        let c = &mut candidates[0];
        let (data, name) = (header(c), file_name(c));
        assert!(fits(&data, c));
        assert!(!fits(&data[..31], c) && !fits(&[], c), "cut");
        assert!(name.contains(&format!("{:016x}", crate::shaders::HASH)), "{name}");
        for byte in [4, 8, 12, 16, 31] {
            let mut other = data.clone();
            other[byte] ^= 1;
            assert!(!fits(&other, c), "byte {byte} tells another device");
        }
        c.cache_uuid[15] ^= 1;
        assert_ne!(file_name(c), name, "another build of the driver");
        c.cache_uuid[15] ^= 1;
        c.info.driver_version += "1";
        assert_ne!(file_name(c), name, "another version of it");
    }
}
