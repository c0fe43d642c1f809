//! The pipeline cache of a device. If the caller names a folder, it is kept there between runs, in one file for each
//! combination of device, driver and kernels. The cache only saves time: a file that cannot be used is ignored. Drivers
//! trust the data that they get back, so files that another user could have written are not read.
use super::At;
use super::info::Candidate;
use crate::error::Result;
use ash::vk;
use ash::vk::Handle;
use etcetera::BaseStrategy;
use std::fs::{File, Metadata};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// The file starts with these bytes, followed by the FNV-1a checksum of the driver's data and by that data.
const MAGIC: &[u8; 8] = b"TALLOWP1";
/// Largest file that is read, in bytes. All kernels together take a few million bytes.
const LARGEST: u64 = 64 << 20;
/// Number of cache files to keep. The newest stay, whether of this or of other devices, drivers and kernels.
const KEPT: usize = 16;
/// A temporary file older than this was left behind by a run that was killed.
const ABANDONED: Duration = Duration::from_secs(3600);

/// The folder where the command line keeps compiled pipelines: `tallow` in `$XDG_CACHE_HOME` or `~/.cache`, or on Windows
/// in the local application data.
pub fn cache_folder() -> Option<PathBuf> {
    let folder = etcetera::choose_base_strategy().ok()?.cache_dir();
    folder.is_absolute().then(|| folder.join("tallow"))
}

#[derive(Default)]
pub(super) struct PipelineCache {
    pub raw: vk::PipelineCache,
    file: Option<PathBuf>,
    /// Checksum of the data that were read, so that an unchanged cache is not written again.
    loaded: u64,
}

impl PipelineCache {
    /// # Errors
    /// The device is out of memory.
    pub fn new(device: &ash::Device, candidate: &Candidate, folder: Option<PathBuf>) -> Result<Self> {
        let file = folder.map(|folder| folder.join(file_name(candidate)));
        let data = file.as_deref().and_then(read).filter(|data| fits(data, candidate)).unwrap_or_default();
        let create = |data: &[u8]| {
            let info = vk::PipelineCacheCreateInfo::default().initial_data(data);
            // SAFETY: the data came from this driver (file name, checksum, header), and nobody but the user could write them.
            unsafe { device.create_pipeline_cache(&info, None) }
        };
        // A driver that refuses what it has written begins anew.
        let raw = create(&data).or_else(|_| create(&[])).at("pipeline cache")?;
        Ok(Self { raw, file, loaded: checksum(&data) })
    }

    /// # Safety
    /// `device` made this cache, if any did; nothing uses it, and it is not used again.
    pub unsafe fn store_and_destroy(&self, device: &ash::Device) {
        if self.raw.is_null() {
            return;
        }
        if let Some(file) = &self.file
            // SAFETY: `device` made this cache, by contract.
            && let Ok(data) = unsafe { device.get_pipeline_cache_data(self.raw) }
            && checksum(&data) != self.loaded
        {
            // A failure is harmless: the next run compiles again.
            let _ = write(file, &data);
        }
        unsafe { device.destroy_pipeline_cache(self.raw, None) };
    }
}

fn file_name(candidate: &Candidate) -> String {
    let uuid: String = candidate.cache_uuid.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("{uuid}-{}-{:016x}.bin", candidate.info.driver_version, crate::shaders::HASH)
}

/// Returns the driver's data if the file is complete and only the user can write it.
fn read(file: &Path) -> Option<Vec<u8>> {
    let folder = std::fs::metadata(file.parent()?).ok()?;
    if !(folder.is_dir() && is_private(&folder)) {
        return None;
    }
    let mut bytes = Vec::new();
    let file = open(file).filter(|file| file.metadata().is_ok_and(|kind| kind.is_file() && is_private(&kind)))?;
    file.take(LARGEST + 1).read_to_end(&mut bytes).ok()?;
    let (sum, data) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<8>()?;
    (bytes.len() as u64 <= LARGEST && checksum(data) == u64::from_le_bytes(*sum)).then(|| data.to_vec())
}

/// Writes a temporary file in the same folder and renames it, so that a reader sees all of it or nothing.
fn write(file: &Path, data: &[u8]) -> std::io::Result<()> {
    let folder = file.parent().unwrap_or(Path::new("."));
    make_folder(folder)?;
    if !is_private(&std::fs::metadata(folder)?) {
        return Err(std::io::Error::other("the folder is not the user's alone"));
    }
    let mut temporary = tempfile::NamedTempFile::new_in(folder)?;
    temporary.write_all(MAGIC)?;
    temporary.write_all(&checksum(data).to_le_bytes())?;
    temporary.write_all(data)?;
    temporary.persist(file)?;
    prune(folder)
}

/// Removes abandoned temporary files, and all but the newest [`KEPT`] caches.
fn prune(folder: &Path) -> std::io::Result<()> {
    let (mut temporary, mut caches) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let (name, changed) = (entry.file_name(), entry.metadata()?.modified()?);
        match name.to_str() {
            Some(name) if name.starts_with(".tmp") && name.len() == 10 => temporary.push((changed, entry.path())),
            Some(name) if is_cache(name) => caches.push((changed, entry.path())),
            _ => {}
        }
    }
    caches.sort_by_key(|(changed, _)| std::cmp::Reverse(*changed));
    let since = SystemTime::now().checked_sub(ABANDONED);
    let left = temporary.into_iter().filter(|(changed, _)| since.is_some_and(|since| *changed < since));
    left.chain(caches.into_iter().skip(KEPT)).try_for_each(|(_, path)| std::fs::remove_file(path))
}

/// Whether `name` has the form that [`file_name`] gives.
fn is_cache(name: &str) -> bool {
    let hex = |part: &str, digits| part.len() == digits && part.bytes().all(|b| b.is_ascii_hexdigit());
    let parts = name.strip_suffix(".bin").and_then(|name| name.split_once('-'));
    parts
        .and_then(|(uuid, rest)| Some((uuid, rest.rsplit_once('-')?.1)))
        .is_some_and(|(uuid, kernels)| hex(uuid, 2 * vk::UUID_SIZE) && hex(kernels, 16))
}

/// Opens the path without following a link and without blocking on a pipe.
#[cfg(unix)]
fn open(path: &Path) -> Option<File> {
    use rustix::fs::{Mode, OFlags};
    let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
    Some(rustix::fs::open(path, flags, Mode::empty()).ok()?.into())
}

#[cfg(not(unix))]
fn open(path: &Path) -> Option<File> {
    std::fs::symlink_metadata(path).ok().filter(Metadata::is_file)?;
    File::open(path).ok()
}

/// Whether the user owns the file and nobody else may write it. Root does not trust a user's files either.
#[cfg(unix)]
fn is_private(kind: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    owned_alone(kind.uid(), kind.mode(), rustix::process::geteuid().as_raw())
}

#[cfg(unix)]
fn owned_alone(owner: u32, mode: u32, user: u32) -> bool {
    owner == user && mode & 0o022 == 0
}

#[cfg(not(unix))]
fn is_private(_: &Metadata) -> bool {
    true
}

/// Makes the folder and its missing parents, accessible to the user alone. It refuses to do so below another user's
/// folder: under `sudo`, the result would belong to root and be of no use to that user.
#[cfg(unix)]
fn make_folder(folder: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::{DirBuilderExt, MetadataExt};
    let above = folder.ancestors().find_map(|above| std::fs::metadata(above).ok());
    let me = rustix::process::geteuid().as_raw();
    if above.is_some_and(|above| ![me, 0].contains(&above.uid())) {
        return Err(std::io::Error::other("the folder above is another user's"));
    }
    std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder)
}

#[cfg(not(unix))]
fn make_folder(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)
}

/// Whether the header (`VkPipelineCacheHeaderVersionOne`) names this device and driver build.
fn fits(data: &[u8], candidate: &Candidate) -> bool {
    let word = |at: usize| data.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    word(4) == Some(vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32)
        && word(8) == Some(candidate.info.vendor_id)
        && word(12) == Some(candidate.info.device_id)
        && data.get(16..32) == Some(&candidate.cache_uuid)
}

/// FNV-1a of 64 bits. It detects accidental damage, not tampering.
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

    #[cfg(unix)]
    #[test]
    fn only_files_of_the_users_own_are_read() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mode = |path: &Path, mode| std::fs::set_permissions(path, PermissionsExt::from_mode(mode)).unwrap();
        write(&at("cache.bin"), b"data").unwrap();
        for wide in [0o620, 0o602] {
            mode(&at("cache.bin"), wide);
            assert_eq!(read(&at("cache.bin")), None, "{wide:o}");
        }
        mode(&at("cache.bin"), 0o600);
        assert!(read(&at("cache.bin")).is_some(), "control");
        for (name, target) in [("link", at("cache.bin")), ("zero", "/dev/zero".into()), ("loop", at("loop"))] {
            symlink(target, at(name)).unwrap();
            assert_eq!(read(&at(name)), None, "{name}");
        }
        rustix::fs::mknodat(rustix::fs::CWD, at("pipe"), rustix::fs::FileType::Fifo, 0o600.into(), 0).unwrap();
        assert_eq!(read(&at("pipe")), None, "a pipe that nobody writes to");
        std::fs::create_dir(at("folder")).unwrap();
        assert_eq!(read(&at("folder")), None);
        mode(folder.path(), 0o777);
        assert_eq!(read(&at("cache.bin")), None, "anybody may have put it there");
        assert!(write(&at("other.bin"), b"data").is_err());
        mode(folder.path(), 0o700);
        assert!(read(&at("cache.bin")).is_some(), "control");
        assert!(!owned_alone(1000, 0o600, 0), "root believes no user");
        assert!(!owned_alone(0, 0o600, 1000) && owned_alone(1000, 0o755, 1000));
    }

    #[cfg(unix)]
    #[test]
    fn folders_are_closed_to_others() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        write(&folder.path().join("a/b/cache.bin"), b"data").unwrap();
        for made in ["a", "a/b", "a/b/cache.bin"] {
            let mode = std::fs::metadata(folder.path().join(made)).unwrap().permissions().mode();
            assert_eq!(mode & 0o077, 0, "{made}: {mode:o}");
        }
    }

    #[test]
    fn a_file_larger_than_any_cache_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cache.bin");
        write(&path, &vec![0; LARGEST as usize - 16]).unwrap();
        assert!(read(&path).is_some());
        write(&path, &vec![0; LARGEST as usize - 15]).unwrap();
        assert_eq!(read(&path), None);
    }

    #[test]
    fn what_earlier_runs_left_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let aged = |name: &str, hours| {
            let file = File::create(at(name)).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_secs(hours * 3600)).unwrap();
        };
        let cache = |n: usize| format!("{n:032x}-1.2.3-{n:016x}.bin");
        (0..20).for_each(|n| aged(&cache(n), 100 + n as u64));
        ["notes.bin", ".tmpnotes", "a-b-c.bin", ".tmpAAAAAA"].iter().for_each(|name| aged(name, 1000));
        aged(".tmpBBBBBB", 0);
        write(&at(&cache(99)), b"data").unwrap();
        let name = |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
        let mut left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(name).collect();
        let newest = (0..KEPT - 1).chain([99]).map(cache);
        let others = ["notes.bin", ".tmpnotes", "a-b-c.bin", ".tmpBBBBBB"].map(String::from);
        let mut expected: Vec<_> = newest.chain(others).collect();
        left.sort();
        expected.sort();
        assert_eq!(left, expected);
    }

    /// A `VkPipelineCacheHeaderVersionOne` (length, version 1, vendor, device, 16 bytes of the driver), then some data.
    fn header(c: &Candidate) -> Vec<u8> {
        let words = [32, vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32, c.info.vendor_id, c.info.device_id];
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
