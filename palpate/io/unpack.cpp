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

bool unpack_lz4(std::string_view packed, std::string& out) {
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
  return hint == 0 && written == out.size();
}

/// Memory grows with what really comes out: a damaged file may announce gigabytes.
constexpr std::size_t piece_bytes = std::size_t{1} << 20;

std::optional<std::string> unpack_bz2(std::string_view packed, std::uint64_t size) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return std::nullopt;
  // The library does not change its input; its interface is older than const.
  stream.next_in = const_cast<char*>(packed.data());
  stream.avail_in = static_cast<unsigned>(packed.size());
  std::string out;
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
  return code == BZ_STREAM_END && out.size() == size ? std::optional<std::string>(std::move(out)) : std::nullopt;
}

std::optional<std::string> unpack_frames(std::string_view packed, std::uint64_t most) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(), ZSTD_freeDStream);
  std::string out, piece(ZSTD_DStreamOutSize(), '\0');
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  std::size_t left = 1;
  while (in.pos < in.size) {
    ZSTD_outBuffer to{piece.data(), piece.size(), 0};
    left = ZSTD_decompressStream(stream.get(), &to, &in);
    if (ZSTD_isError(left) || out.size() > most) return std::nullopt;
    out.append(piece, 0, to.pos);
    if (left == 0) continue;  // the end of a frame; another may follow
  }
  if (left != 0) return std::nullopt;
  return out;
}

}  // namespace

std::optional<std::string> unpack(std::string_view packed, const std::string& compression, std::uint64_t size) {
  if (size > largest_block || packed.size() > largest_block) return std::nullopt;
  if (compression.empty() || compression == "none")
    return packed.size() == size ? std::optional<std::string>(packed) : std::nullopt;
  if (compression == "zstd") {
    auto out = unpack_frames(packed, size);
    return out && out->size() == size ? std::move(out) : std::nullopt;
  }
  if (compression == "bz2") return unpack_bz2(packed, size);
  constexpr std::uint64_t lz4_ratio = 256, lz4_head = 64;  // no byte of it can stand for more than 255
  if (compression != "lz4" || size > lz4_ratio * (packed.size() + lz4_head)) return std::nullopt;
  std::string out(size, '\0');
  return unpack_lz4(packed, out) ? std::optional<std::string>(std::move(out)) : std::nullopt;
}

std::optional<std::string> unpack_zstd(std::string_view packed) { return unpack_frames(packed, largest_block); }

}  // namespace palpate::io
