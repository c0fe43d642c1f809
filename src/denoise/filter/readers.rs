//! Which filters read a setting.

/// Settings that only some filters read, by the names of their options, and the names of these filters.
const READERS: &[(&str, &[&str])] = &[
    ("sigma-rt", &["atrous", "bilateral", "wavelet"]),
    ("sigma-n", &["atrous", "bilateral", "wavelet", "svgf", "auto"]),
    ("sigma-x", &["atrous", "bilateral", "wavelet", "svgf", "auto"]),
    ("levels", &["atrous", "wavelet", "svgf", "auto"]),
    ("radius", &["bilateral", "guided", "auto"]),
    ("form", &["atrous"]),
    ("rt-from-level", &["atrous"]),
    ("conserve-energy", &["atrous"]),
    ("channels", &["guided", "auto"]),
    ("eps", &["guided", "auto"]),
    ("sums", &["guided"]),
    ("basis", &["wavelet"]),
    ("sigma-l", &["svgf", "auto"]),
    ("oidn-quality", &["oidn"]),
];

/// Names of the filters that read a setting, which is given by the name of its option; none where it belongs to the image.
pub fn readers(option: &str) -> &'static [&'static str] {
    READERS.iter().find(|(name, _)| *name == option).map_or(&[], |(_, filters)| filters)
}
