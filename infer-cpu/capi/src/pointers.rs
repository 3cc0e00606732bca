//! Pointers of C callers, checked as far as they can be.

use std::ffi::{CStr, c_char};
use std::path::PathBuf;

use crate::failure::Failure;
use crate::status::EdgepuckStatus;

/// What `pointer`, the argument called `name`, points at.
///
/// # Safety
/// If it is neither null nor misaligned, it points at a `T` that nobody changes
/// during `'a`.
pub unsafe fn shared<'a, T>(pointer: *const T, name: &'static str) -> Result<&'a T, Failure> {
    check(pointer, name)?;
    // SAFETY: not null and aligned; the rest is this function's contract.
    Ok(unsafe { &*pointer })
}

/// The same, to be changed.
///
/// # Safety
/// If it is neither null nor misaligned, it points at a `T` that nobody else
/// uses during `'a`.
pub unsafe fn exclusive<'a, T>(pointer: *mut T, name: &'static str) -> Result<&'a mut T, Failure> {
    check(pointer, name)?;
    // SAFETY: not null and aligned; the rest is this function's contract.
    Ok(unsafe { &mut *pointer })
}

/// That a `T` may lie at `pointer`, the argument called `name`.
pub fn check<T>(pointer: *const T, name: &'static str) -> Result<(), Failure> {
    match pointer.is_null() || !pointer.is_aligned() {
        true => {
            let message = format!(
                "expected `{name}` to be an aligned pointer, found a null or misaligned one"
            );
            Err(Failure::new(EdgepuckStatus::BadPointer, message))
        }
        false => Ok(()),
    }
}

/// The points of a cloud, `[n, 3]`.
///
/// # Safety
/// If `xyz` is neither null nor misaligned, `3 n` floats lie there that nobody
/// changes during `'a`.
pub unsafe fn cloud<'a>(xyz: *const f32, n: usize) -> Result<&'a [[f32; 3]], Failure> {
    if n == 0 {
        return Ok(&[]);
    }
    check(xyz, "xyz")?;
    match n.checked_mul(size_of::<[f32; 3]>()) {
        Some(n_bytes) if isize::try_from(n_bytes).is_ok() => {
            // SAFETY: not null, aligned, and no longer than a slice may be; the
            // rest is the caller's promise.
            Ok(unsafe { std::slice::from_raw_parts(xyz.cast(), n) })
        }
        _ => {
            let message = format!("expected a cloud that fits in memory, found {n} points");
            Err(Failure::new(EdgepuckStatus::BadCloud, message))
        }
    }
}

/// The bytes of a packet.
///
/// # Safety
/// If `packet` is not null, `n` bytes lie there that nobody changes during `'a`.
pub unsafe fn bytes<'a>(packet: *const u8, n: usize) -> Result<&'a [u8], Failure> {
    check(packet, "packet")?;
    if isize::try_from(n).is_err() {
        let message = format!("expected a packet that fits in memory, found {n} bytes");
        return Err(Failure::new(EdgepuckStatus::BadPointer, message));
    }
    // SAFETY: not null, and no longer than a slice may be; the rest is the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(packet, n) })
}

/// The path at `pointer`: bytes as they are on Unix, UTF-8 elsewhere.
///
/// # Safety
/// If it is not null, it is a NUL-terminated string.
pub unsafe fn path(pointer: *const c_char) -> Result<PathBuf, Failure> {
    check(pointer, "path")?;
    // SAFETY: not null; the rest is this function's contract.
    let path = unsafe { CStr::from_ptr(pointer) };
    #[cfg(unix)]
    let path: &std::ffi::OsStr = std::os::unix::ffi::OsStrExt::from_bytes(path.to_bytes());
    #[cfg(not(unix))]
    let path = path.to_string_lossy().into_owned();
    Ok(PathBuf::from(path))
}
