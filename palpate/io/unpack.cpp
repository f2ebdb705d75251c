// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/unpack.hpp"

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <memory>

namespace palpate::io {
namespace {

constexpr std::uint64_t largest_block = std::uint64_t{1} << 31;

// Each gives what comes out in `out`, and true when that is the whole of what was packed.

bool unpack_lz4(std::string_view packed, std::uint64_t size, std::string& out) {
  constexpr std::uint64_t ratio = 256, head = 64;  // no byte of it can stand for more than 255
  if (size > ratio * (packed.size() + head)) return false;
  out.resize(size);
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) return false;
  std::size_t read = 0, written = 0, hint = 1;
  while (hint != 0 && read < packed.size()) {
    std::size_t in = packed.size() - read, room = out.size() - written;
    hint = LZ4F_decompress(context, out.data() + written, &room, packed.data() + read, &in, nullptr);
    if (LZ4F_isError(hint) || (in == 0 && room == 0)) break;
    read += in;
    written += room;
  }
  LZ4F_freeDecompressionContext(context);
  out.resize(written);
  return hint == 0;
}

/// Memory grows with what really comes out: a damaged file may announce gigabytes.
constexpr std::size_t piece_bytes = std::size_t{1} << 20;

bool unpack_bz2(std::string_view packed, std::uint64_t size, std::string& out) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return false;
  // The library does not change its input; its interface is older than const.
  stream.next_in = const_cast<char*>(packed.data());
  stream.avail_in = static_cast<unsigned>(packed.size());
  int code = BZ_OK;
  while (code == BZ_OK && out.size() <= size) {
    const std::size_t before = out.size();
    out.resize(before + std::min<std::size_t>(piece_bytes, size + 1 - before));
    stream.next_out = out.data() + before;
    stream.avail_out = static_cast<unsigned>(out.size() - before);
    code = BZ2_bzDecompress(&stream);
    const bool stuck = stream.avail_in == 0 && stream.avail_out > 0;
    out.resize(out.size() - stream.avail_out);
    if (stuck) break;
  }
  BZ2_bzDecompressEnd(&stream);
  return code == BZ_STREAM_END;
}

bool unpack_frames(std::string_view packed, std::uint64_t most, std::string& out) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(), ZSTD_freeDStream);
  std::string piece(ZSTD_DStreamOutSize(), '\0');
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  std::size_t left = 1;
  while (in.pos < in.size) {
    ZSTD_outBuffer to{piece.data(), piece.size(), 0};
    left = ZSTD_decompressStream(stream.get(), &to, &in);
    if (ZSTD_isError(left) || out.size() > most) return false;
    out.append(piece, 0, to.pos);
    if (left == 0) continue;  // the end of a frame; another may follow
  }
  return left == 0;
}

bool unpack_into(std::string& out, std::string_view packed, const std::string& compression, std::uint64_t size) {
  if (size > largest_block || packed.size() > largest_block) return false;
  if (compression.empty() || compression == "none") {
    out = packed;
    return true;
  }
  if (compression == "zstd") return unpack_frames(packed, size, out);
  if (compression == "bz2") return unpack_bz2(packed, size, out);
  return compression == "lz4" && unpack_lz4(packed, size, out);
}

}  // namespace

std::optional<std::string> unpack(std::string_view packed, const std::string& compression, std::uint64_t size) {
  std::string out;
  if (!unpack_into(out, packed, compression, size) || out.size() != size) return std::nullopt;
  return out;
}

std::string unpack_what_is_left(std::string_view packed, const std::string& compression, std::uint64_t size) {
  std::string out;
  unpack_into(out, packed, compression, size);
  if (out.size() > size) out.resize(size);
  return out;
}

std::optional<std::string> unpack_zstd(std::string_view packed) {
  std::string out;
  if (!unpack_frames(packed, largest_block, out)) return std::nullopt;
  return out;
}

}  // namespace palpate::io
