//! Open Image Denoise, loaded when it is asked for: a program that is built without it finds it where it is installed. It runs on
//! the host's processor.
use crate::error::{Checked, Error, Result};
use bytemuck::Pod;
use libloading::Library;
use std::env;
use std::ffi::{CStr, OsString, c_char, c_int, c_void};
use std::sync::OnceLock;

/// Environment variable that names the library's file where the system does not find it.
pub const OIDN_VARIABLE: &str = "TALLOW_OIDN";

/// Files that the system is asked for, in this order.
const FILES: &[&str] = if cfg!(target_os = "windows") {
    &["OpenImageDenoise.dll"]
} else if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"]
} else {
    &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]
};

const HOW_TO_GET: &str = "install your system's package of Open Image Denoise 2, or unpack its official release and set TALLOW_OIDN \
                          to the library file in it";

/// An `OIDNDevice` or an `OIDNFilter`.
type Handle = *mut c_void;

// Values of the library's header.
const DEVICE_CPU: c_int = 1;
const FORMAT_FLOAT3: c_int = 3;

/// Declares the functions of the library that are used, and loads them by their names.
macro_rules! functions {
    ($($name:ident = $symbol:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        struct Functions {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            /// The library stays loaded, because it may have threads of its own.
            fn of(library: Library) -> Checked<Self> {
                let missing = |symbol| format!("it is no Open Image Denoise 2 (it has no {symbol})");
                // SAFETY: version 2 of the library declares its functions so.
                let functions = unsafe {
                    Self { $($name: *library.get($symbol.to_bytes()).map_err(|_| missing($symbol.to_string_lossy()))?,)* }
                };
                std::mem::forget(library);
                Ok(functions)
            }
        }
    };
}

functions! {
    new_device = c"oidnNewDevice": fn(c_int) -> Handle;
    commit_device = c"oidnCommitDevice": fn(Handle);
    device_error = c"oidnGetDeviceError": fn(Handle, *mut *const c_char) -> c_int;
    device_int = c"oidnGetDeviceInt": fn(Handle, *const c_char) -> c_int;
    release_device = c"oidnReleaseDevice": fn(Handle);
    new_filter = c"oidnNewFilter": fn(Handle, *const c_char) -> Handle;
    set_image = c"oidnSetSharedFilterImage":
        fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);
    set_bool = c"oidnSetFilterBool": fn(Handle, *const c_char, bool);
    set_int = c"oidnSetFilterInt": fn(Handle, *const c_char, c_int);
    commit_filter = c"oidnCommitFilter": fn(Handle);
    execute_filter = c"oidnExecuteFilter": fn(Handle);
    release_filter = c"oidnReleaseFilter": fn(Handle);
}

/// The library's functions; they are looked for once.
fn functions() -> Result<&'static Functions> {
    static LOADED: OnceLock<Checked<Functions>> = OnceLock::new();
    let load = || match env::var_os(OIDN_VARIABLE).filter(|file| !file.is_empty()) {
        Some(file) => load(&file).map_err(|what| format!("{OIDN_VARIABLE}: {what}")),
        None => installed(),
    };
    let refused = |what: &String| Error::Device(format!("Open Image Denoise cannot be loaded: {what}: {HOW_TO_GET}"));
    LOADED.get_or_init(load).as_ref().map_err(refused)
}

/// The first of [`FILES`] that can be used; what is wrong with the first of all is what a user wants to know.
fn installed() -> Checked<Functions> {
    let mut found = FILES.iter().map(|file| load(&OsString::from(file)));
    let first = found.next().unwrap_or_else(|| Err("it has no known name on this system".to_owned()));
    first.or_else(|what| found.find_map(std::result::Result::ok).ok_or(what))
}

fn load(file: &OsString) -> Checked<Functions> {
    // SAFETY: what a library runs when it is loaded is trusted as that of the Vulkan loader is: the system or the user names it.
    let library = unsafe { Library::new(file) }.map_err(|e| e.to_string())?;
    Functions::of(library).map_err(|what| format!("{}: {what}", file.display()))
}

/// Three floats of every pixel: they begin `offset` bytes into an element of a slice.
#[derive(Clone, Copy)]
pub struct Texels<'a> {
    pixels: &'a [u8],
    stride: usize,
    offset: usize,
}

impl<'a> Texels<'a> {
    /// # Panics
    /// Where an element ends before the three floats do, or the floats are not aligned.
    pub fn new<T: Pod>(pixels: &'a [T], offset: usize) -> Self {
        let stride = size_of::<T>();
        assert!(offset + size_of::<[f32; 3]>() <= stride && offset.is_multiple_of(4) && align_of::<T>() >= 4);
        Self { pixels: bytemuck::cast_slice(pixels), stride, offset }
    }

    fn len(&self) -> usize {
        self.pixels.len() / self.stride
    }
}

/// The images that the library reads, row-major, linear.
pub struct OidnInput<'a> {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Noisy radiance.
    pub colour: Texels<'a>,
    /// Reflectance of what is seen. Without it, normals are not used either.
    pub albedo: Option<Texels<'a>>,
    /// Normals of what is seen.
    pub normal: Option<Texels<'a>>,
    /// The library's number of its quality.
    pub quality: i32,
}

/// Open Image Denoise on the host's processor.
pub struct Oidn {
    functions: &'static Functions,
    device: Handle,
}

impl Oidn {
    /// Loads the library and prepares its threads.
    ///
    /// # Errors
    /// [`Error::Device`] where it is not installed, or refuses this processor.
    pub fn open() -> Result<Self> {
        let functions = functions()?;
        // SAFETY: a new device may be null; then what went wrong is asked of the thread, and no more is called.
        let device = unsafe { (functions.new_device)(DEVICE_CPU) };
        let oidn = Self { functions, device };
        oidn.check("opening the processor")?;
        if device.is_null() {
            return Err(Error::Device("Open Image Denoise found no device".to_owned()));
        }
        // SAFETY: a live device.
        unsafe { (functions.commit_device)(device) };
        oidn.check("opening the processor")?;
        Ok(oidn)
    }

    /// The library's version.
    pub fn version(&self) -> String {
        // SAFETY: a live device and a name with its zero; it reads no more than the name.
        let part = |name: &CStr| unsafe { (self.functions.device_int)(self.device, name.as_ptr()) };
        [c"versionMajor", c"versionMinor", c"versionPatch"].map(|name| part(name).to_string()).join(".")
    }

    /// Filters radiance of any range; the first three floats of every element of `output` are written.
    ///
    /// # Errors
    /// [`Error::Usage`] where an image has another number of pixels, [`Error::Device`] with the library's own message.
    pub fn filter(&self, input: &OidnInput, output: &mut [[f32; 4]]) -> Result<()> {
        let pixels = input.size[0] as usize * input.size[1] as usize;
        let normal = input.normal.filter(|_| input.albedo.is_some());
        let images = [(c"color", Some(input.colour)), (c"albedo", input.albedo), (c"normal", normal)];
        let lengths = images.iter().filter_map(|(_, image)| Some(image.as_ref()?.len()));
        if pixels == 0 || lengths.chain([output.len()]).any(|length| length != pixels) {
            return Err(Error::Usage(format!("Open Image Denoise was given images that are not {:?}", input.size)));
        }
        let f = self.functions;
        // SAFETY: a live device; a filter of null is not used.
        let filter = unsafe { (f.new_filter)(self.device, c"RT".as_ptr()) };
        self.check("making a filter")?;
        let written = (output.as_mut_ptr().cast::<c_void>(), size_of::<[f32; 4]>());
        // SAFETY: a live filter. The images outlive it and hold as many pixels as it is told (checked above); the one that is
        // written is borrowed for writing.
        unsafe {
            for (name, image) in images.into_iter().filter_map(|(name, image)| Some((name, image?))) {
                let first = image.pixels[image.offset..].as_ptr().cast_mut().cast();
                set_image(f, filter, name, (first, image.stride), input.size);
            }
            set_image(f, filter, c"output", written, input.size);
            (f.set_bool)(filter, c"hdr".as_ptr(), true);
            (f.set_int)(filter, c"quality".as_ptr(), input.quality);
            (f.commit_filter)(filter);
            (f.execute_filter)(filter);
            (f.release_filter)(filter);
        }
        self.check("filtering")
    }

    /// The first error since it was asked for last.
    fn check(&self, doing: &str) -> Result<()> {
        let mut message = std::ptr::null();
        // SAFETY: a live device or null, and a place for a pointer.
        let code = unsafe { (self.functions.device_error)(self.device, &mut message) };
        if code == 0 {
            return Ok(());
        }
        let said = match message.is_null() {
            true => format!("error {code}").into(),
            // SAFETY: a text with its zero, which lives until the library is called again.
            false => unsafe { CStr::from_ptr(message) }.to_string_lossy(),
        };
        Err(Error::Device(format!("Open Image Denoise, {doing}: {said}")))
    }
}

impl Drop for Oidn {
    fn drop(&mut self) {
        if !self.device.is_null() {
            // SAFETY: a live device, released once; its filters are gone.
            unsafe { (self.functions.release_device)(self.device) };
        }
    }
}

/// Tells a filter where the three floats of the first pixel lie, and how many bytes behind them those of the next.
///
/// # Safety
/// A live filter, and an image of this size that outlives it.
unsafe fn set_image(
    functions: &Functions,
    filter: Handle,
    name: &CStr,
    (first, stride): (*mut c_void, usize),
    [width, height]: [u32; 2],
) {
    let [width, height] = [width as usize, height as usize];
    // SAFETY: the caller's; rows follow each other without gaps.
    unsafe { (functions.set_image)(filter, name.as_ptr(), first, FORMAT_FLOAT3, width, height, 0, stride, 0) };
}
